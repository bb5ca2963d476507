//! What the kernels of all packers have in common: how work is shared among threads,
//! and how what became of a frame is read back.

use std::marker::PhantomData;

use bytemuck::Pod;

use crate::gpu::{Gpu, GpuError};

/// More patches than last frame that the first copy back has room for.
const SPARE: u32 = 1024;

/// How the work is shared among threads. Results do not depend on it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Threads {
    /// Consecutive patches of one thread.
    pub(crate) run: u32,
    /// Threads of a group that sums up: a power of two up to 256.
    pub(crate) lanes: u32,
}

impl Threads {
    /// Many threads keep a GPU busy. A driver in software counts faster in a few
    /// long runs, and pays for each barrier with every thread of a group.
    pub(crate) fn best(gpu: &Gpu) -> Self {
        let [run, lanes] = if gpu.is_software { [128, 8] } else { [32, 256] };
        Self { run, lanes }
    }
}

/// A packer's state, which tells how many patches have a slot.
pub(crate) trait CountsActive {
    fn active_count(&self) -> u32;
}

/// What a packer leaves of a frame, on the way back: its state, and a list of the
/// patches that have a slot, as long as there are any.
#[derive(Debug)]
pub(crate) struct Outcomes<State, Item> {
    state: wgpu::Buffer,
    list: wgpu::Buffer,
    readback: wgpu::Buffer,
    /// Items of the longest list.
    most: u32,
    /// Items that the next copy back has room for.
    expected: u32,
    of: PhantomData<(State, Item)>,
}

impl<State: Pod + CountsActive, Item: Pod> Outcomes<State, Item> {
    const STATE: u64 = size_of::<State>() as u64;
    const ITEM: u64 = size_of::<Item>() as u64;

    /// For a `list` of at most `most` items, of which `state` tells how many there are.
    pub(crate) fn new(gpu: &Gpu, state: &wgpu::Buffer, list: &wgpu::Buffer, most: u32) -> Self {
        Self {
            state: state.clone(),
            list: list.clone(),
            readback: gpu.readback("placement", Self::STATE),
            most,
            expected: 0,
            of: PhantomData,
        }
    }

    /// Submits the recorded work and reads what became of it. A copy as long as the last
    /// list and a little longer mostly has it all, and else the rest is fetched.
    pub(crate) fn submit_and_read(
        &mut self,
        gpu: &Gpu,
        mut encoder: wgpu::CommandEncoder,
    ) -> Result<(State, Vec<Item>), GpuError> {
        let expected = self.expected.min(self.most);
        let copied = u64::from(expected) * Self::ITEM;
        let bytes = Self::STATE + copied;
        if self.readback.size() < bytes {
            self.readback = gpu.readback("placement", bytes + bytes / 2);
        }
        encoder.copy_buffer_to_buffer(&self.state, 0, &self.readback, 0, Self::STATE);
        encoder.copy_buffer_to_buffer(&self.list, 0, &self.readback, Self::STATE, copied);
        let (state, mut items) = gpu.submit_and_read(encoder, &self.readback, bytes, |bytes| {
            let (state, list) = bytes.split_at(Self::STATE as usize);
            let state: State = bytemuck::pod_read_unaligned(state);
            let known = state.active_count().min(expected) as usize;
            let list = &list[..known * size_of::<Item>()];
            (state, bytemuck::pod_collect_to_vec::<u8, Item>(list))
        })?;
        let count = state.active_count().min(self.most);
        if count > expected {
            let rest = u64::from(expected) * Self::ITEM..u64::from(count) * Self::ITEM;
            items.extend(gpu.read::<Item>(&self.list, rest)?);
        }
        self.expected = count + count / 4 + SPARE;
        Ok((state, items))
    }
}
