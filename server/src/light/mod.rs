//! Path-traced radiance at the texels of placed patches.
//!
//! Light lives in object space and linear HDR, apart from the surface that it
//! falls on and from the eye that sees it. A texel's means grow sample by sample
//! while its slot stays; what moves to another slot is taken over, texel by texel
//! where they lie alike and else resampled. Each update has a budget of paths,
//! spent where it is needed most.
//!
//! Source: SAS 2018, section 3.2; the accumulation and the budget are ours.

mod paths;
mod schedule;
#[cfg(test)]
mod tests;

use glam::Vec3;
use shadecast_protocol::{Block, Method, Slot, TriangleSlot};
use shadecast_shaders::light::{
    ATLAS_OF_TRIANGLES_SOURCE, ATLAS_SOURCE, BlockRecord, CARRY_SOURCE, CARRY_TRIANGLES_SOURCE,
    CELL_BYTES, CELL_COUNT, CarryParameters, JUDGEMENT_BYTES, LightParameters, Move, NO_BLOCK,
    Quality, TriangleMove, TriangleRecord, how,
};
use wgpu::ShaderStages;

use crate::{
    atlas::Placed,
    gpu::{Binding, Gpu, GpuError, GpuScene, bind, layout, workgroups},
};

pub use paths::{Ends, Paths};
pub use schedule::{Job, Lasting, Schedule};

/// Most slots that are lit or moved by one update.
const MOST_SLOTS: u64 = 1 << 18;

/// Who looks at the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewer {
    /// Metres, in the world.
    pub eye: Vec3,
    /// In the middle of its picture.
    pub pixels_per_radian: f32,
    /// Factor from radiance to displayed brightness.
    pub exposure: f32,
}

/// How often stages run that leave the same when they run again: more than once
/// only to tell what they cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Repeats {
    /// Traversal of rays.
    pub traversal: u32,
    /// Smoothing of slots.
    pub smoothing: u32,
}

/// The accumulated radiance and the kernels that make it.
#[derive(Debug)]
pub struct Light {
    atlas_width: u32,
    texels: Texels,
    /// As they were before slots moved; made when one first moves.
    texels_before: Option<Texels>,
    /// What was shown before, where it comes along.
    shown_before: Option<wgpu::Buffer>,
    shown: wgpu::Buffer,
    parameters: wgpu::Buffer,
    kernels: SlotKernels,
    slots: wgpu::Buffer,
    most_tiles: u64,
    qualities: wgpu::Buffer,
    qualities_readback: wgpu::Buffer,
    paths: Paths,
    start: wgpu::ComputePipeline,
    change: wgpu::ComputePipeline,
    accumulate: wgpu::ComputePipeline,
    measure: wgpu::ComputePipeline,
    smooth: wgpu::ComputePipeline,
    fade: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    carry: wgpu::ComputePipeline,
    carry_layout: wgpu::BindGroupLayout,
    carry_parameters: wgpu::Buffer,
    moves: wgpu::Buffer,
    /// See [`Repeats`].
    smoothings: u32,
    /// See [`make_even`](Self::make_even).
    is_even: bool,
}

/// What is built differently for each kind of slot.
#[derive(Clone, Copy, Debug)]
struct SlotKernels {
    source: &'static str,
    carry_source: &'static str,
    carry: &'static str,
    record_bytes: u64,
    move_bytes: u64,
    /// Whether moves take along what is shown: see [`keeps_shown`].
    carries_shown: bool,
}

impl SlotKernels {
    const fn of(method: Method) -> Self {
        match method {
            Method::Sas => Self {
                source: ATLAS_SOURCE,
                carry_source: CARRY_SOURCE,
                carry: "carry_blocks",
                record_bytes: size_of::<BlockRecord>() as u64,
                move_bytes: size_of::<Move>() as u64,
                carries_shown: false,
            },
            Method::Tss | Method::Snake => Self {
                source: ATLAS_OF_TRIANGLES_SOURCE,
                carry_source: CARRY_TRIANGLES_SOURCE,
                carry: "carry_triangles",
                record_bytes: size_of::<TriangleRecord>() as u64,
                move_bytes: size_of::<TriangleMove>() as u64,
                carries_shown: true,
            },
        }
    }
}

/// What texels remember: see `atlas.wgsl`.
#[derive(Debug)]
struct Texels {
    diffuse: wgpu::Buffer,
    glossy: wgpu::Buffer,
    moments: wgpu::Buffer,
}

impl Texels {
    fn new(gpu: &Gpu, count: u64) -> Result<Self, GpuError> {
        Ok(Self {
            diffuse: gpu.scratch("diffuse light", count * 16)?,
            glossy: gpu.scratch("glossy light", count * 16)?,
            moments: gpu.scratch("moments of light", count * 16)?,
        })
    }

    fn buffers(&self) -> [&wgpu::Buffer; 3] {
        [&self.diffuse, &self.glossy, &self.moments]
    }
}

impl Light {
    /// An atlas of `size` texels, all unlit, with the slots of `method`.
    ///
    /// # Errors
    /// When the atlas is larger than the device binds.
    pub fn new(
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        size: [u16; 2],
        method: Method,
    ) -> Result<Self, GpuError> {
        let kernels = SlotKernels::of(method);
        let texel_count = u64::from(size[0]) * u64::from(size[1]);
        let most_slots = MOST_SLOTS.min(texel_count / 4).max(1);
        // A small slot is a tile; the tiles of large ones have 16 texels and more, but for
        // rows of one texel: `trace` takes no more than there is room for.
        let most_tiles = most_slots + texel_count / 16;
        let own_layout = layout(
            gpu,
            ShaderStages::COMPUTE,
            &[
                Binding::Uniform,
                Binding::Read,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
            ],
        );
        let texels = Texels::new(gpu, texel_count)?;
        let shown = gpu.scratch("shown", texel_count * 16)?;
        let cells = gpu.scratch("cells", u64::from(CELL_COUNT) * CELL_BYTES)?;
        let parameters = gpu.uniform("light parameters", size_of::<LightParameters>());
        let slots = gpu.scratch("slots", most_slots * kernels.record_bytes)?;
        let quality_bytes = most_slots * size_of::<Quality>() as u64;
        let qualities = gpu.scratch("qualities", quality_bytes)?;
        let judgements = gpu.scratch("judgements of tiles", most_tiles * JUDGEMENT_BYTES)?;
        let group = bind(
            gpu,
            &own_layout,
            &[
                &parameters,
                &slots,
                &texels.diffuse,
                &texels.glossy,
                &qualities,
                &shown,
                &texels.moments,
                &cells,
                &judgements,
            ],
        );
        let paths = Paths::new(gpu, gpu_scene, texel_count as u32)?;
        let layouts = [&gpu_scene.layout, &paths.layout, &own_layout];
        let pipeline =
            |entry| gpu.compute_pipeline(kernels.source, entry, &layouts, &gpu_scene.constants);
        let mut carry_bindings = vec![
            Binding::Uniform,
            Binding::Read,
            Binding::Read,
            Binding::Read,
            Binding::Read,
            Binding::Write,
            Binding::Write,
            Binding::Write,
        ];
        if kernels.carries_shown {
            carry_bindings.extend([Binding::Read, Binding::Write]);
        }
        let carry_layout = layout(gpu, ShaderStages::COMPUTE, &carry_bindings);
        Ok(Self {
            atlas_width: u32::from(size[0]),
            start: pipeline("start_at_texels"),
            change: pipeline("measure_change"),
            accumulate: pipeline("accumulate"),
            measure: pipeline("measure_noise"),
            smooth: pipeline("smooth_slots"),
            fade: pipeline("fade_cells"),
            paths,
            carry: gpu.compute_pipeline(kernels.carry_source, kernels.carry, &[&carry_layout], &[]),
            carry_layout,
            carry_parameters: gpu.uniform("carry parameters", size_of::<CarryParameters>()),
            moves: gpu.scratch("moves", most_slots * kernels.move_bytes)?,
            texels,
            texels_before: None,
            shown_before: None,
            shown,
            parameters,
            kernels,
            slots,
            most_tiles,
            smoothings: 1,
            is_even: false,
            qualities_readback: gpu.readback("qualities", quality_bytes),
            qualities,
            group,
        })
    }

    /// Rays traced so far.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn rays(&self, gpu: &Gpu) -> Result<u64, GpuError> {
        self.paths.rays(gpu)
    }

    /// How often stages run from now on.
    pub fn set_repeats(&mut self, repeats: Repeats) {
        self.paths.repeats = repeats.traversal;
        self.smoothings = repeats.smoothing;
    }

    /// From now on every texel has the light of a white surroundings and nothing else:
    /// surfaces show their own colour, without noise.
    pub fn make_even(&mut self, gpu: &Gpu) {
        // As many samples that nothing is smoothed.
        const SAMPLES: f32 = 1e6;
        let contents = [
            [1.0, 1.0, 1.0, SAMPLES],
            [0.0, 0.0, 0.0, SAMPLES],
            [0.0, 1.0, 0.0, 0.0],
        ];
        for (buffer, content) in self.texels.buffers().into_iter().zip(contents) {
            let all = vec![content; (buffer.size() / 16) as usize];
            gpu.queue
                .write_buffer(buffer, 0, bytemuck::cast_slice(&all));
        }
        self.is_even = true;
    }

    /// Whether it was made even.
    #[must_use]
    pub fn is_even(&self) -> bool {
        self.is_even
    }

    /// The radiance to show and the samples behind it, four floats a texel, row by row.
    #[must_use]
    pub fn shown(&self) -> &wgpu::Buffer {
        &self.shown
    }

    /// Gives the slots of `placed` their first content, and clears the atlas on a reset.
    ///
    /// # Errors
    /// When the device has no room for the copy that moving needs.
    pub fn record_moves(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        placed: &Placed,
    ) -> Result<(), GpuError> {
        if self.is_even {
            // It is everywhere already.
            if placed.reset {
                encoder.clear_buffer(&self.shown, 0, None);
            }
            return Ok(());
        }
        let most = (self.moves.size() / self.kernels.move_bytes) as usize;
        let mut moves: Vec<u32> = Vec::new();
        let mut carries = false;
        let mut moved = placed.moved.iter().peekable();
        for placement in placed.placements.iter().take(most) {
            let old = moved
                .next_if(|(patch, ..)| *patch == placement.patch)
                .map(|(_, old, _)| *old);
            carries |= old.is_some();
            record_move(placement.slot, old, &mut moves);
        }
        let move_count = placed.placements.len().min(most) as u32;
        if carries {
            let before = match self.texels_before.take() {
                Some(before) => before,
                None => Texels::new(gpu, self.texels.diffuse.size() / 16)?,
            };
            for (from, to) in self.texels.buffers().into_iter().zip(before.buffers()) {
                encoder.copy_buffer_to_buffer(from, 0, to, 0, None);
            }
            self.texels_before = Some(before);
            if self.kernels.carries_shown {
                let before = match self.shown_before.take() {
                    Some(before) => before,
                    None => gpu.scratch("shown before", self.shown.size())?,
                };
                encoder.copy_buffer_to_buffer(&self.shown, 0, &before, 0, None);
                self.shown_before = Some(before);
            }
        }
        if placed.reset {
            for buffer in self.texels.buffers() {
                encoder.clear_buffer(buffer, 0, None);
            }
            encoder.clear_buffer(&self.shown, 0, None);
        }
        if move_count == 0 {
            return Ok(());
        }
        gpu.queue
            .write_buffer(&self.moves, 0, bytemuck::cast_slice(&moves));
        let parameters = CarryParameters {
            move_count,
            atlas_width: self.atlas_width,
            padding: [0; 2],
        };
        gpu.queue
            .write_buffer(&self.carry_parameters, 0, bytemuck::bytes_of(&parameters));
        // Without anything to carry the copies are never read: any buffer will do.
        let before = match &self.texels_before {
            Some(before) => before.buffers(),
            None => [&self.slots; 3],
        };
        let now = self.texels.buffers();
        let mut buffers = [&[&self.carry_parameters, &self.moves], &before[..], &now].concat();
        if self.kernels.carries_shown {
            buffers.extend([
                self.shown_before.as_ref().unwrap_or(&self.slots),
                &self.shown,
            ]);
        }
        let group = bind(gpu, &self.carry_layout, &buffers);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.carry);
        pass.set_bind_group(0, &group, &[]);
        let (x, y) = workgroups(move_count, 1);
        pass.dispatch_workgroups(x, y, 1);
        Ok(())
    }

    /// Traces the paths of `jobs`, of which a slot has one at most: a texel takes its
    /// paths one after the other. Tells how many of the jobs there was room for.
    pub fn trace(&self, gpu: &Gpu, gpu_scene: &GpuScene, jobs: &[Job], viewer: Viewer) -> usize {
        let mut records = Vec::new();
        let (mut path_count, mut tile_count) = (0, 0);
        let jobs = &jobs[..jobs.len().min(self.most_slots())];
        let mut slot_count = 0;
        for job in jobs {
            if u64::from(tile_count + job.tiles()) > self.most_tiles {
                break;
            }
            job.record([path_count, tile_count], &mut records);
            path_count += job.paths();
            tile_count += job.tiles();
            slot_count += 1;
        }
        self.set_slots(gpu, &records, [slot_count, tile_count], viewer);
        let ends = Ends {
            start: &self.start,
            before_finish: Some((&self.change, tile_count)),
            finish: &self.accumulate,
            group: &self.group,
            from_camera: false,
        };
        self.paths.follow(gpu, gpu_scene, ends, path_count);
        slot_count as usize
    }

    /// Makes what is shown of the slots of `lit`, which were traced, and of `unlit`,
    /// and tells how well each of the former is known. No slot is in both.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn show(
        &self,
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        lit: &[Job],
        unlit: &[Job],
        viewer: Viewer,
    ) -> Result<Vec<Quality>, GpuError> {
        let count = (lit.len() + unlit.len()).min(self.most_slots());
        if count == 0 {
            return Ok(Vec::new());
        }
        let mut records = Vec::new();
        for job in lit.iter().chain(unlit).take(count) {
            job.record([0; 2], &mut records);
        }
        let lit = lit.len().min(count);
        self.set_slots(gpu, &records, [count as u32, 0], viewer);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_bind_group(0, &gpu_scene.group, &[]);
            pass.set_bind_group(1, &self.paths.group, &[]);
            pass.set_bind_group(2, &self.group, &[]);
            pass.set_pipeline(&self.fade);
            pass.dispatch_workgroups(CELL_COUNT / 64, 1, 1);
            pass.set_pipeline(&self.smooth);
            let (x, y) = workgroups(count as u32, 1);
            for _ in 0..self.smoothings {
                pass.dispatch_workgroups(x, y, 1);
            }
            pass.set_pipeline(&self.measure);
            pass.dispatch_workgroups((count as u32).div_ceil(64), 1, 1);
        }
        if lit == 0 {
            gpu.queue.submit([encoder.finish()]);
            return Ok(Vec::new());
        }
        let bytes = lit as u64 * size_of::<Quality>() as u64;
        encoder.copy_buffer_to_buffer(&self.qualities, 0, &self.qualities_readback, 0, bytes);
        gpu.submit_and_read(encoder, &self.qualities_readback, bytes, |bytes| {
            bytemuck::cast_slice(bytes).to_vec()
        })
    }

    fn most_slots(&self) -> usize {
        (self.slots.size() / self.kernels.record_bytes) as usize
    }

    fn set_slots(
        &self,
        gpu: &Gpu,
        records: &[u32],
        [slot_count, tile_count]: [u32; 2],
        viewer: Viewer,
    ) {
        let parameters = LightParameters {
            eye: viewer.eye.to_array(),
            slot_count,
            atlas_width: self.atlas_width,
            tile_count,
            pixel_angle: 1.0 / viewer.pixels_per_radian,
            exposure: viewer.exposure,
        };
        gpu.queue
            .write_buffer(&self.parameters, 0, bytemuck::bytes_of(&parameters));
        gpu.queue
            .write_buffer(&self.slots, 0, bytemuck::cast_slice(records));
    }
}

/// Whether the texels of a slot may be taken over from another one as they are.
pub fn keeps_texels(old: Slot, new: Slot) -> bool {
    match (old, new) {
        (Slot::Block(old), Slot::Block(new)) => old.level == new.level,
        (Slot::Triangle(old), Slot::Triangle(new)) => new.is_laid_like(old),
        _ => false,
    }
}

/// Whether what is shown of a slot comes along from another one. Blocks mostly move
/// because their level changes; triangles that others push aside are many.
pub fn keeps_shown(old: Slot, new: Slot) -> bool {
    matches!(new, Slot::Triangle(_)) && keeps_texels(old, new)
}

/// Appends the record of a move, as words.
fn record_move(new: Slot, old: Option<Slot>, moves: &mut Vec<u32>) {
    match (new, old) {
        (Slot::Block(new), Some(Slot::Block(old))) => {
            moves.extend_from_slice(bytemuck::cast_slice(&[move_record(new, Some(old))]));
        }
        // All slots of a stream are of one kind.
        (Slot::Block(new), _) => {
            moves.extend_from_slice(bytemuck::cast_slice(&[move_record(new, None)]));
        }
        (Slot::Triangle(new), old) => {
            let old = match old {
                Some(Slot::Triangle(old)) => Some(old),
                _ => None,
            };
            moves.extend_from_slice(bytemuck::cast_slice(&[triangle_move(new, old)]));
        }
    }
}

fn triangle_move(new: TriangleSlot, old: Option<TriangleSlot>) -> TriangleMove {
    let from = old.unwrap_or(new);
    let (how, [offset_x, offset_y]) = match old.map(|old| new.shift_from(old)) {
        None => (how::FROM_NOTHING, [0; 2]),
        Some(None) => (how::RESAMPLED, [0; 2]),
        Some(Some((1, offset))) => (how::SHIFTED, offset),
        Some(Some((_, offset))) => (how::TURNED_ROUND, offset),
    };
    TriangleMove {
        to: corner_words(new),
        to_weights: weight_words(new),
        origin: corner_words(from),
        origin_weights: weight_words(from),
        how,
        offset_x,
        offset_y,
    }
}

fn corner_words(slot: TriangleSlot) -> [u32; 3] {
    slot.corners.map(|[x, y]| u32::from(x) | u32::from(y) << 16)
}

fn weight_words(slot: TriangleSlot) -> [u32; 2] {
    let [a, b, c] = slot.weights.map(u32::from);
    [a | b << 16, c]
}

fn position_bits(block: Block) -> u32 {
    u32::from(block.x) | u32::from(block.y) << 16
}

fn level_bits(block: Block) -> u32 {
    let level = block.level.landscape();
    u32::from(level.width) | u32::from(level.height) << 4
}

fn move_record(new: Block, old: Option<Block>) -> Move {
    let turns = old.is_some_and(|old| old.level.is_turned() != new.level.is_turned());
    Move {
        to: position_bits(new),
        levels: level_bits(new) | old.map_or(0, level_bits) << 8 | u32::from(turns) << 16,
        origin: old.map_or(NO_BLOCK, position_bits),
        padding: 0,
    }
}
