//! All images as one list of texels with mip levels.

use glam::Vec3;

use crate::scene::{Image, Material, Scene, TextureRef};

/// All images with their mip levels, one after the other.
pub(super) struct Texels {
    pub(super) texels: Vec<u32>,
    /// Offset, size and levels of each image as (linear, sRGB) data.
    pub(super) places: Vec<[Option<Place>; 2]>,
    pub(super) halvings: u32,
}

#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) offset: u32,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) levels: u32,
}

impl Texels {
    pub(super) fn pack(scene: &Scene, most: usize) -> Self {
        let mut uses = vec![[false; 2]; scene.images.len()];
        for material in &scene.materials {
            for (slot, texture) in slots(material).iter().enumerate() {
                if let Some(texture) = texture {
                    uses[texture.image as usize][usize::from(is_srgb(slot))] = true;
                }
            }
        }
        let texel_count = |halvings: u32| -> usize {
            let side = |s: u32| ((s >> halvings).max(1)) as usize;
            (scene.images.iter().zip(&uses))
                .map(|(image, used)| {
                    let copies = used.iter().filter(|u| **u).count();
                    copies * side(image.width) * side(image.height) * 4 / 3 + 64
                })
                .sum()
        };
        let halvings = (0..16).find(|&h| texel_count(h) <= most).unwrap_or(16);
        let mut packed = Self {
            texels: Vec::new(),
            places: Vec::new(),
            halvings,
        };
        for (image, used) in scene.images.iter().zip(uses) {
            let places = [false, true]
                .map(|srgb| used[usize::from(srgb)].then(|| packed.add(image, srgb, halvings)));
            packed.places.push(places);
        }
        packed
    }

    fn add(&mut self, image: &Image, srgb: bool, halvings: u32) -> Place {
        let roots: [u8; 256] =
            std::array::from_fn(|byte| (linear_from_srgb(byte as u8).sqrt() * 255.0 + 0.5) as u8);
        let (mut width, mut height) = (image.width, image.height);
        let mut level: Vec<u32> = image
            .rgba
            .chunks_exact(4)
            .map(|c| {
                let rgb = [c[0], c[1], c[2]]
                    .map(|byte| if srgb { roots[usize::from(byte)] } else { byte });
                u32::from_le_bytes([rgb[0], rgb[1], rgb[2], c[3]])
            })
            .collect();
        for _ in 0..halvings {
            (level, width, height) = halved(&level, width, height, srgb);
        }
        let place = Place {
            offset: self.texels.len() as u32,
            width,
            height,
            levels: 1,
        };
        let mut levels = 1;
        self.texels.extend(&level);
        while width > 1 || height > 1 {
            (level, width, height) = halved(&level, width, height, srgb);
            self.texels.extend(&level);
            levels += 1;
        }
        Place { levels, ..place }
    }
}

pub(super) fn linear_from_srgb(byte: u8) -> f32 {
    let c = f32::from(byte) / 255.0;
    if c <= 0.040_45 {
        c / 12.92
    } else {
        ((c + 0.055) / 1.055).powf(2.4)
    }
}

/// The next mip level: the mean of two by two texels, in linear light.
pub(super) fn halved(texels: &[u32], width: u32, height: u32, srgb: bool) -> (Vec<u32>, u32, u32) {
    let (w, h) = ((width / 2).max(1), (height / 2).max(1));
    // Colours are square roots of linear light.
    let decode = |byte: u8| {
        let c = f32::from(byte) / 255.0;
        if srgb { c * c } else { c }
    };
    let encode = |c: f32| ((if srgb { c.sqrt() } else { c }) * 255.0 + 0.5) as u8;
    let mut out = Vec::with_capacity((w * h) as usize);
    for y in 0..h {
        for x in 0..w {
            let mut sum = [0.0; 4];
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (sx, sy) = ((2 * x + dx).min(width - 1), (2 * y + dy).min(height - 1));
                let bytes = texels[(sy * width + sx) as usize].to_le_bytes();
                for (channel, byte) in bytes.into_iter().enumerate() {
                    sum[channel] += if channel == 3 {
                        f32::from(byte) / 255.0
                    } else {
                        decode(byte)
                    };
                }
            }
            let alpha = (sum[3] * 0.25 * 255.0 + 0.5) as u8;
            out.push(u32::from_le_bytes([
                encode(sum[0] * 0.25),
                encode(sum[1] * 0.25),
                encode(sum[2] * 0.25),
                alpha,
            ]));
        }
    }
    (out, w, h)
}

/// The slots in the order of the record.
pub(super) fn slots(material: &Material) -> [Option<TextureRef>; 4] {
    [
        material.base_color_texture,
        material.metallic_roughness_texture,
        material.normal_texture,
        material.emissive_texture,
    ]
}

pub(super) fn is_srgb(slot: usize) -> bool {
    slot == 0 || slot == 3
}

/// Mean of an sRGB image in linear light.
pub(super) fn mean_color(image: &Image) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for texel in image.rgba.chunks_exact(4) {
        sum += Vec3::from([texel[0], texel[1], texel[2]].map(linear_from_srgb));
    }
    sum / (image.rgba.len() / 4).max(1) as f32
}
