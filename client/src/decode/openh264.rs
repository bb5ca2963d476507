//! OpenH264, the software decoder of the desktop.
//!
//! It answers within `send`, one picture per access unit. Its pictures lie in
//! its own padded buffers; they are copied row by row into tight planes.

use std::collections::VecDeque;

use openh264::decoder::{DecodedYUV, Decoder as OpenH264};
use openh264::formats::YUVSource;

use super::{AccessUnit, DecodeError, Decoded, Decoder, StridedPlane};
use crate::YuvPicture;

/// Decodes on the thread that calls it.
#[derive(Default)]
pub struct OpenH264Decoder {
    /// None until the first unit, and again after a flush or an error: a new
    /// one is the only state of the library that is surely clean.
    inner: Option<OpenH264>,
    ready: VecDeque<Decoded>,
}

impl OpenH264Decoder {
    /// A decoder that waits for an IDR picture.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    fn decode(&mut self, unit: &AccessUnit) -> Result<YuvPicture, DecodeError> {
        let inner = match &mut self.inner {
            Some(inner) => inner,
            empty => empty.insert(
                OpenH264::new().map_err(|error| DecodeError::Unavailable(error.to_string()))?,
            ),
        };
        let picture = inner
            .decode(&unit.bytes)
            .map_err(|error| DecodeError::Refused(error.to_string()))?
            .ok_or(DecodeError::NoPicture)?;
        tight_picture(&picture, unit.size.map(u32::from))
    }
}

impl std::fmt::Debug for OpenH264Decoder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OpenH264Decoder")
            .field("ready", &self.ready.len())
            .finish_non_exhaustive()
    }
}

impl Decoder for OpenH264Decoder {
    fn send(&mut self, unit: AccessUnit) {
        let picture = self.decode(&unit);
        if picture.is_err() {
            self.inner = None;
        }
        self.ready.push_back(Decoded {
            ticket: unit.ticket,
            picture: picture.map(Into::into),
        });
    }

    fn poll(&mut self) -> Option<Decoded> {
        self.ready.pop_front()
    }

    fn flush(&mut self) {
        self.inner = None;
        self.ready.clear();
    }
}

/// Copies the visible part of the planes.
fn tight_picture(picture: &DecodedYUV<'_>, expected: [u32; 2]) -> Result<YuvPicture, DecodeError> {
    let (width, height) = picture.dimensions();
    let found = [width as u32, height as u32];
    if found != expected {
        return Err(DecodeError::Size { expected, found });
    }
    let (y_stride, u_stride, v_stride) = picture.strides();
    let plane = |bytes, row_stride| StridedPlane {
        bytes,
        row_stride,
        texel_stride: 1,
    };
    let planes = [
        plane(picture.y(), y_stride),
        plane(picture.u(), u_stride),
        plane(picture.v(), v_stride),
    ];
    YuvPicture::of_planes(found, planes)
        .ok_or_else(|| DecodeError::Refused("a plane is smaller than the picture".into()))
}

#[cfg(test)]
mod tests {
    use openh264::encoder::Encoder;
    use openh264::formats::YUVBuffer;
    use proptest::prelude::*;
    use shadecast_protocol::FrameId;

    use super::*;
    use crate::decode::Ticket;

    /// One access unit per picture; the picture of step `n` is grey value
    /// `40 + 20 n` with a gradient, so that it can be told from the others.
    fn stream(size: [u16; 2], steps: u8) -> Vec<Vec<u8>> {
        let mut encoder = Encoder::new().unwrap();
        (0..steps)
            .map(|step| {
                let picture =
                    YUVBuffer::from_vec(raw_picture(size, step), size[0].into(), size[1].into());
                encoder.encode(&picture).unwrap().to_vec()
            })
            .collect()
    }

    fn raw_picture(size: [u16; 2], step: u8) -> Vec<u8> {
        let [width, height] = size.map(usize::from);
        let luma = (0..width * height).map(|i| 40 + 20 * step + (i % width / 8) as u8);
        let chroma = std::iter::repeat_n(128, width * height / 2);
        luma.chain(chroma).collect()
    }

    fn unit(frame: u32, size: [u16; 2], bytes: &[u8]) -> AccessUnit {
        AccessUnit {
            ticket: Ticket {
                connection: 0,
                frame: FrameId(frame),
            },
            restart: frame == 0,
            size,
            bytes: bytes.to_vec(),
        }
    }

    fn decode(decoder: &mut OpenH264Decoder, unit: AccessUnit) -> Result<YuvPicture, DecodeError> {
        let ticket = unit.ticket;
        decoder.send(unit);
        let decoded = decoder.poll().unwrap();
        assert_eq!(decoded.ticket, ticket);
        assert_eq!(decoder.poll(), None);
        decoded
            .picture
            .map(|picture| picture.planes().expect("in memory").clone())
    }

    fn mean_difference(a: &[u8], b: &[u8]) -> f64 {
        assert_eq!(a.len(), b.len());
        let sum: u64 = a
            .iter()
            .zip(b)
            .map(|(a, b)| u64::from(a.abs_diff(*b)))
            .sum();
        sum as f64 / a.len() as f64
    }

    #[test]
    fn pictures_come_back_in_order_without_padding() {
        // Neither side is a multiple of a macroblock, so that the stream crops.
        let size = [72, 40];
        let mut decoder = OpenH264Decoder::new();
        for (step, bytes) in stream(size, 5).iter().enumerate() {
            let picture = decode(&mut decoder, unit(step as u32, size, bytes)).unwrap();
            assert_eq!((picture.width, picture.height), (72, 40));
            let raw = raw_picture(size, step as u8);
            assert!(mean_difference(&picture.y, &raw[..72 * 40]) < 3.0);
            assert!(mean_difference(&picture.u, &raw[72 * 40..][..36 * 20]) < 3.0);
            assert!(mean_difference(&picture.v, &raw[72 * 40..][..36 * 20]) < 3.0);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn garbage_is_survived(
            units in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..400), 1..6),
        ) {
            let mut decoder = OpenH264Decoder::new();
            for (frame, bytes) in units.iter().enumerate() {
                prop_assert!(decode(&mut decoder, unit(frame as u32, [64, 64], bytes)).is_err());
            }
        }

        #[test]
        fn truncated_and_corrupted_streams_are_survived(
            cut in any::<prop::sample::Index>(),
            flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
        ) {
            let size = [64, 48];
            let units = stream(size, 3);
            let mut decoder = OpenH264Decoder::new();
            for (frame, bytes) in units.iter().enumerate() {
                let mut bytes = bytes.clone();
                for (place, value) in &flips {
                    let place = place.index(bytes.len());
                    bytes[place] ^= value;
                }
                bytes.truncate(cut.index(bytes.len()));
                let picture = decode(&mut decoder, unit(frame as u32, size, &bytes));
                if let Ok(picture) = picture {
                    prop_assert_eq!(picture.y.len(), 64 * 48);
                    prop_assert_eq!(picture.u.len(), 32 * 24);
                }
            }
            decoder.flush();
            prop_assert!(decode(&mut decoder, unit(0, size, &units[0])).is_ok());
        }
    }
}
