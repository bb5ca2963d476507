//! What glTF has no words for, in the `extras` of the scene:
//! `{"shadecast": {"sky": {"zenith": [r, g, b], "horizon": [..], "ground": [..]},
//! "sun_angular_radius": radians}}`.

use serde::{Deserialize, Serialize};

use super::LoadError;
use crate::scene::SkyModel;

/// The whole of a scene's `extras`; other programs' entries are skipped.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(in crate::scene) struct Extras {
    #[serde(default)]
    pub(in crate::scene) shadecast: Own,
}

/// Our entry.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(in crate::scene) struct Own {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(in crate::scene) sky: Option<Sky>,
    /// Of all directional lights.
    #[serde(default)]
    pub(in crate::scene) sun_angular_radius: f32,
}

/// A [`SkyModel`].
#[derive(Debug, Serialize, Deserialize)]
pub(in crate::scene) struct Sky {
    pub(in crate::scene) zenith: [f32; 3],
    pub(in crate::scene) horizon: [f32; 3],
    pub(in crate::scene) ground: [f32; 3],
}

impl Extras {
    /// The extras of the default scene; none where they are not ours.
    pub(super) fn of(document: &gltf::Document) -> Self {
        document
            .default_scene()
            .or(document.scenes().next())
            .and_then(|scene| scene.extras().as_ref())
            .and_then(|extras| serde_json::from_str(extras.get()).ok())
            .unwrap_or_default()
    }

    pub(super) fn sky(&self) -> Result<SkyModel, LoadError> {
        let Some(sky) = &self.shadecast.sky else {
            return Ok(SkyModel::BLACK);
        };
        let colors = [sky.zenith, sky.horizon, sky.ground];
        if colors.iter().flatten().any(|c| !c.is_finite() || *c < 0.0) {
            return Err(LoadError::invalid("the sky", "is not finite or negative"));
        }
        let [zenith, horizon, ground] = colors.map(glam::Vec3::from_array);
        Ok(SkyModel {
            zenith,
            horizon,
            ground,
        })
    }

    /// Half angle of the sun's disc, radians.
    pub(super) fn sun_angular_radius(&self) -> f32 {
        let radius = self.shadecast.sun_angular_radius;
        if radius.is_finite() {
            radius.clamp(0.0, 0.5)
        } else {
            0.0
        }
    }
}
