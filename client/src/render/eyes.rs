//! The two eyes: where each is, and the pictures that they see.

use glam::{Mat4, Vec3, Vec4};
use shadecast_protocol::{EyeView, Fov, Pose};

/// Nearest distance that is drawn, metres: closer than eyes converge, and far
/// enough for a head that leans against a wall.
pub(crate) const NEAR: f32 = 0.02;

/// One eye in the world and what it sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeCamera {
    /// Where the eye is.
    pub world_from_eye: Pose,
    /// Its four sides.
    pub fov: Fov,
}

impl EyeCamera {
    /// Left and right eye of a head.
    #[must_use]
    pub fn pair(world_from_head: Pose, eyes: &[EyeView; 2]) -> [Self; 2] {
        eyes.map(|eye| Self {
            world_from_eye: world_from_head.then(eye.head_from_eye),
            fov: eye.fov,
        })
    }

    /// Reversed-Z clip space from the world.
    pub(super) fn clip_from_world(self) -> Mat4 {
        self.fov.projection(NEAR) * self.world_from_eye.inverse().matrix()
    }

    /// Direction in the world from (x, y, 1) with x and y in normalised device
    /// coordinates. The direction is linear in them, so that a rasteriser may
    /// interpolate it.
    pub(super) fn world_ray_from_ndc(self) -> Mat4 {
        let [left, right, up, down] = self.fov.tangents();
        let rotate = |ray: Vec3| (self.world_from_eye.orientation * ray).extend(0.0);
        Mat4::from_cols(
            rotate(Vec3::X * ((right - left) * 0.5)),
            rotate(Vec3::Y * ((up - down) * 0.5)),
            rotate(Vec3::new((right + left) * 0.5, (up + down) * 0.5, -1.0)),
            Vec4::ZERO,
        )
    }
}

/// One picture an eye, as the two layers of a texture.
#[derive(Debug)]
pub struct EyeImages {
    texture: wgpu::Texture,
    array: wgpu::TextureView,
    layers: [wgpu::TextureView; 2],
}

impl EyeImages {
    /// Pictures to draw into, to sample and to read back.
    #[must_use]
    pub fn new(device: &wgpu::Device, size: [u32; 2], format: wgpu::TextureFormat) -> Self {
        Self::from_texture(device.create_texture(&wgpu::TextureDescriptor {
            label: Some("eyes"),
            size: wgpu::Extent3d {
                width: size[0],
                height: size[1],
                depth_or_array_layers: 2,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        }))
    }

    /// Draws into a texture of two layers that another made, for example the
    /// swapchain image of a headset.
    #[must_use]
    pub fn from_texture(texture: wgpu::Texture) -> Self {
        let array = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        let layers = [0, 1].map(|layer| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..wgpu::TextureViewDescriptor::default()
            })
        });
        Self {
            texture,
            array,
            layers,
        }
    }

    /// The texture; layer 0 is the left eye.
    #[must_use]
    pub fn texture(&self) -> &wgpu::Texture {
        &self.texture
    }

    /// Both layers as one view.
    pub(super) fn array(&self) -> &wgpu::TextureView {
        &self.array
    }

    /// Left and right.
    pub(super) fn layers(&self) -> &[wgpu::TextureView; 2] {
        &self.layers
    }
}
