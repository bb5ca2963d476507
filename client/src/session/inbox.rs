//! Messages that wait for their turn, in frame order and within bounds.

use std::collections::BTreeMap;

use shadecast_protocol::{
    ClientTime, FrameId, Motion, PatchGeometry, PatchId, Picture, Placement, Update, Vertex,
};

/// Most frames that wait: about a second. Whoever is further behind starts anew.
const MAX_FRAMES: usize = 64;

/// Most bytes that wait: some seconds of video, or one large message of any kind.
const MAX_BYTES: usize = 64 << 20;

/// What arrived for frames that have not had their turn.
#[derive(Debug)]
pub(super) struct Inbox<T> {
    waiting: BTreeMap<FrameId, Arrived<T>>,
    bytes: usize,
}

/// A message and when it came.
#[derive(Debug)]
pub(super) struct Arrived<T> {
    pub(super) message: T,
    pub(super) at: ClientTime,
}

/// Something that belongs to a frame and takes memory.
pub(super) trait Weighed {
    fn frame(&self) -> FrameId;
    /// About how many bytes it keeps.
    fn weight(&self) -> usize;
}

impl<T: Weighed> Inbox<T> {
    pub(super) fn new() -> Self {
        Self {
            waiting: BTreeMap::new(),
            bytes: 0,
        }
    }

    /// Takes a message; a second one for the same frame is dropped.
    pub(super) fn insert(&mut self, at: ClientTime, message: T) {
        let weight = message.weight();
        self.waiting.entry(message.frame()).or_insert_with(|| {
            self.bytes += weight;
            Arrived { message, at }
        });
    }

    pub(super) fn overflows(&self) -> bool {
        self.waiting.len() > MAX_FRAMES || (self.bytes > MAX_BYTES && self.waiting.len() > 1)
    }

    pub(super) fn contains(&self, frame: FrameId) -> bool {
        self.waiting.contains_key(&frame)
    }

    pub(super) fn first_frame(&self) -> Option<FrameId> {
        self.waiting.keys().next().copied()
    }

    /// From the newest to the oldest.
    pub(super) fn newest_first(&self) -> impl Iterator<Item = &T> {
        self.waiting.values().rev().map(|arrived| &arrived.message)
    }

    pub(super) fn take(&mut self, frame: FrameId) -> Option<Arrived<T>> {
        let arrived = self.waiting.remove(&frame)?;
        self.bytes -= arrived.message.weight();
        Some(arrived)
    }

    pub(super) fn take_first(&mut self) -> Option<Arrived<T>> {
        let first = self.first_frame()?;
        self.take(first)
    }

    pub(super) fn take_before(&mut self, frame: FrameId) -> Option<Arrived<T>> {
        let first = self.first_frame().filter(|&first| first < frame)?;
        self.take(first)
    }

    pub(super) fn clear(&mut self) {
        self.waiting.clear();
        self.bytes = 0;
    }
}

impl Weighed for Picture {
    fn frame(&self) -> FrameId {
        self.frame
    }

    fn weight(&self) -> usize {
        self.bytes.len()
    }
}

impl Weighed for Update {
    fn frame(&self) -> FrameId {
        self.frame
    }

    fn weight(&self) -> usize {
        let masks: usize = self.masks.iter().map(|mask| mask.bits.len()).sum();
        size_of_val::<[Vertex]>(&self.vertices)
            + size_of_val::<[PatchGeometry]>(&self.patches)
            + size_of_val::<[PatchId]>(&self.removals)
            + size_of_val::<[Placement]>(&self.placements)
            + size_of_val::<[(_, Motion)]>(&self.motions)
            + masks
    }
}

#[cfg(test)]
mod tests {
    use shadecast_protocol::Epoch;

    use super::*;

    fn picture(frame: u32, bytes: usize) -> Picture {
        Picture {
            frame: FrameId(frame),
            epoch: Epoch(0),
            idr: false,
            bytes: vec![0; bytes],
        }
    }

    #[test]
    fn is_ordered_takes_the_first_of_two_and_keeps_count() {
        let mut inbox = Inbox::new();
        for (frame, bytes) in [(5, 1), (3, 2), (5, 9), (4, 3)] {
            inbox.insert(ClientTime(0), picture(frame, bytes));
        }
        assert_eq!(inbox.bytes, 6);
        let frames: Vec<_> = inbox.newest_first().map(|one| one.frame.0).collect();
        assert_eq!(frames, [5, 4, 3]);
        assert!(inbox.take_before(FrameId(3)).is_none());
        assert_eq!(inbox.take_before(FrameId(5)).unwrap().message.frame.0, 3);
        assert_eq!(inbox.take(FrameId(5)).unwrap().message.bytes.len(), 1);
        assert_eq!(inbox.bytes, 3);
    }

    #[test]
    fn overflows_by_frames_and_by_bytes_but_never_by_one_message() {
        let mut many = Inbox::new();
        for frame in 0..MAX_FRAMES as u32 {
            many.insert(ClientTime(0), picture(frame, 0));
            assert!(!many.overflows());
        }
        many.insert(ClientTime(0), picture(1_000, 0));
        assert!(many.overflows());

        let mut large = Inbox::new();
        large.insert(ClientTime(0), picture(0, MAX_BYTES + 1));
        assert!(!large.overflows());
        large.insert(ClientTime(0), picture(1, 1));
        assert!(large.overflows());
    }
}
