//! Hands frames from the network to the drawing thread without either ever
//! waiting for the other: a triple buffer, of which only the newest counts.

use std::sync::Arc;

use crate::ClientFrame;

/// The network's end.
#[derive(Debug)]
pub struct FrameSender(triple_buffer::Input<Option<Arc<ClientFrame>>>);

/// The drawing thread's end.
#[derive(Debug)]
pub struct FrameReceiver(triple_buffer::Output<Option<Arc<ClientFrame>>>);

/// Both ends of a new hand-over.
#[must_use]
pub fn frame_channel() -> (FrameSender, FrameReceiver) {
    let (input, output) = triple_buffer::triple_buffer(&None);
    (FrameSender(input), FrameReceiver(output))
}

impl FrameSender {
    /// Makes `frame` the newest.
    pub fn send(&mut self, frame: Arc<ClientFrame>) {
        self.0.write(Some(frame));
    }
}

impl FrameReceiver {
    /// The newest frame, if it is newer than the last one taken.
    pub fn take_newest(&mut self) -> Option<Arc<ClientFrame>> {
        if self.0.update() {
            self.0.output_buffer_mut().take()
        } else {
            None
        }
    }
}
