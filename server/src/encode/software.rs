//! H.264 on the CPU, by OpenH264.

use openh264::{
    OpenH264API, Timestamp,
    encoder::{
        BitRate, Complexity, Encoder, EncoderConfig, FrameRate, FrameType, IntraFramePeriod,
        RateControlMode, SpsPpsStrategy, UsageType, VuiConfig,
    },
    formats::YUVSource,
};
use openh264_sys2::{ENCODER_OPTION_SVC_ENCODE_PARAM_EXT, SEncParamExt};

use super::{EncodeError, EncodedPicture, Planes, VideoEncoder};

/// `iLoopFilterDisableIdc` that turns the deblocking filter off.
const NO_DEBLOCKING: i32 = 1;

/// The encoder that every build has.
pub struct OpenH264 {
    encoder: Encoder,
    /// The quantisation parameter of all pictures, where it is not the bits that count.
    quality: Option<u8>,
    configured_for: Option<(u32, u32)>,
}

impl std::fmt::Debug for OpenH264 {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OpenH264")
            .field("configured_for", &self.configured_for)
            .finish_non_exhaustive()
    }
}

impl OpenH264 {
    /// Side of the largest square picture that it takes, and so of an atlas, pixels: of
    /// others the longer side is at most 3840.
    pub const LARGEST_SQUARE: u16 = 2160;

    /// For about `bits_per_second` at `pictures_per_second`.
    ///
    /// # Errors
    /// When the library refuses the configuration.
    pub fn new(bits_per_second: u32, pictures_per_second: f32) -> Result<Self, EncodeError> {
        Self::configured(
            config()
                .bitrate(BitRate::from_bps(bits_per_second))
                .max_frame_rate(FrameRate::from_hz(pictures_per_second))
                .rate_control_mode(RateControlMode::Bitrate),
            None,
        )
    }

    /// Of one quality, however many bits it takes: to compare what is encoded.
    /// `step` is H.264's quantisation parameter, from 0 to 51.
    ///
    /// # Errors
    /// When the library refuses the configuration.
    pub fn of_quality(step: u8) -> Result<Self, EncodeError> {
        let config = config().rate_control_mode(RateControlMode::Off);
        Self::configured(config, Some(step.min(51)))
    }

    fn configured(config: EncoderConfig, quality: Option<u8>) -> Result<Self, EncodeError> {
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config)
            .map_err(|error| EncodeError(error.to_string()))?;
        Ok(Self {
            encoder,
            quality,
            configured_for: None,
        })
    }

    /// The crate has no switch for the deblocking filter nor for a fixed quality, and
    /// configures the encoder at the first picture of a size: so that picture is
    /// encoded once, thrown away, and both are set before the real one.
    fn configure(&mut self, planes: &Planes) -> Result<(), EncodeError> {
        let failed = |error: openh264::Error| EncodeError(error.to_string());
        self.encoder.encode(&Source(planes)).map_err(failed)?;
        let mut parameters = SEncParamExt::default();
        let raw = (&raw mut parameters).cast();
        // SAFETY: the encoder was initialised by the call above; the option
        // reads and writes exactly one SEncParamExt, which lives on this frame.
        let refused = unsafe {
            let api = self.encoder.raw_api();
            let mut refused = api.get_option(ENCODER_OPTION_SVC_ENCODE_PARAM_EXT, raw);
            let parameters = &mut *raw.cast::<SEncParamExt>();
            parameters.iLoopFilterDisableIdc = NO_DEBLOCKING;
            if let Some(step) = self.quality {
                parameters.sSpatialLayers[0].iDLayerQp = step.into();
            }
            if refused == 0 {
                refused = api.set_option(ENCODER_OPTION_SVC_ENCODE_PARAM_EXT, raw);
            }
            refused
        };
        if refused != 0 {
            return Err(EncodeError(format!(
                "deblocking and quality cannot be set (code {refused})"
            )));
        }
        self.configured_for = Some((planes.width, planes.height));
        Ok(())
    }
}

/// What does not depend on who encodes.
fn config() -> EncoderConfig {
    EncoderConfig::new()
        .usage_type(UsageType::CameraVideoRealTime)
        .complexity(Complexity::Low)
        .sps_pps_strategy(SpsPpsStrategy::ConstantId)
        .intra_frame_period(IntraFramePeriod::from_num_frames(0))
        .scene_change_detect(false)
        .background_detection(false)
        .adaptive_quantization(false)
        .skip_frames(false)
        .num_threads(1)
        .vui(VuiConfig::bt709())
}

impl VideoEncoder for OpenH264 {
    fn encode(&mut self, planes: &Planes, idr: bool) -> Result<EncodedPicture, EncodeError> {
        let first = self.configured_for != Some((planes.width, planes.height));
        if first {
            self.configure(planes)?;
        }
        if idr || first {
            self.encoder.force_intra_frame();
        }
        let stream = self
            .encoder
            .encode_at(&Source(planes), Timestamp::ZERO)
            .map_err(|error| EncodeError(error.to_string()))?;
        let idr = stream.frame_type() == FrameType::IDR;
        let bytes = stream.to_vec();
        if bytes.is_empty() {
            return Err(EncodeError("it gave no picture".to_owned()));
        }
        Ok(EncodedPicture { bytes, idr })
    }
}

struct Source<'a>(&'a Planes);

impl YUVSource for Source<'_> {
    fn dimensions(&self) -> (usize, usize) {
        (self.0.width as usize, self.0.height as usize)
    }

    fn strides(&self) -> (usize, usize, usize) {
        let half = self.0.width as usize / 2;
        (self.0.width as usize, half, half)
    }

    fn y(&self) -> &[u8] {
        self.0.y()
    }

    fn u(&self) -> &[u8] {
        self.0.u()
    }

    fn v(&self) -> &[u8] {
        self.0.v()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use openh264::decoder::Decoder;

    /// 32 by 32 blocks of strong contrast, as an atlas has them.
    fn blocks(side: u16, shift: u8) -> Planes {
        let (width, height) = (u32::from(side), u32::from(side));
        let mut bytes = vec![128; (width * height * 3 / 2) as usize];
        for y in 0..height {
            for x in 0..width {
                let bright = (x / 32 + y / 32) % 2 == 0;
                bytes[(y * width + x) as usize] = if bright { 200 - shift } else { 40 + shift };
            }
        }
        Planes {
            width,
            height,
            bytes,
        }
    }

    #[test]
    fn the_largest_square_is_taken_and_no_larger_one() {
        let encode = |side| {
            let mut encoder = OpenH264::new(1_000_000, 30.0).unwrap();
            encoder.encode(&blocks(side, 0), true)
        };
        assert!(encode(OpenH264::LARGEST_SQUARE).is_ok());
        assert!(encode(OpenH264::LARGEST_SQUARE + 16).is_err());
    }

    #[test]
    fn pictures_survive_and_block_borders_stay_sharp() {
        let mut encoder = OpenH264::new(200_000, 30.0).unwrap();
        let mut decoder = Decoder::new().unwrap();
        for step in 0..6 {
            let planes = blocks(128, step);
            let picture = encoder.encode(&planes, step == 4).unwrap();
            assert_eq!(picture.idr, step == 0 || step == 4, "picture {step}");
            let decoded = decoder.decode(&picture.bytes).unwrap().expect("a picture");
            assert_eq!(decoded.dimensions(), (128, 128));
            let stride = decoded.strides().0;
            for (x, wanted) in [(31, planes.y()[31]), (32, planes.y()[32])] {
                let found = decoded.y()[stride * 5 + x];
                assert!(
                    found.abs_diff(wanted) <= 6,
                    "picture {step}: {found} is not {wanted}"
                );
            }
        }
    }

    #[test]
    fn a_coarser_quality_takes_fewer_bytes() {
        let bytes = [10, 24, 40].map(|step| {
            let mut encoder = OpenH264::of_quality(step).unwrap();
            let mut planes = blocks(128, 0);
            // Detail that quantisation can lose.
            for (i, value) in planes.bytes[..128 * 128].iter_mut().enumerate() {
                *value += (i * 7 % 13) as u8;
            }
            encoder.encode(&planes, true).unwrap().bytes.len()
        });
        assert!(bytes.is_sorted_by(|a, b| a > b), "{bytes:?}");
    }

    #[test]
    fn the_stream_says_its_colour_space() {
        let mut encoder = OpenH264::new(200_000, 30.0).unwrap();
        let picture = encoder.encode(&blocks(128, 0), true).unwrap();
        // A sequence parameter set comes first.
        assert_eq!(picture.bytes[4] & 31, 7);
    }
}
