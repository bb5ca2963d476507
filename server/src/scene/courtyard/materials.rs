//! What the courtyard is made of.

use glam::{Affine2, Vec2, Vec3, Vec4, vec3};

use super::paint;
use crate::scene::{Alpha, Image, Material, Scene, TextureRef, Wrap};

/// Indices into [`Scene::materials`].
pub(super) struct Palette {
    pub(super) plaster: u32,
    pub(super) limestone: u32,
    pub(super) blocks: u32,
    pub(super) bricks: u32,
    pub(super) voussoirs: u32,
    pub(super) court: u32,
    pub(super) azulejo: u32,
    pub(super) wood: u32,
    pub(super) door: u32,
    pub(super) roof: u32,
    /// Crimson, teal and indigo.
    pub(super) banners: [u32; 3],
    pub(super) orange_tree: u32,
    pub(super) bougainvillea: u32,
    pub(super) clay: u32,
    pub(super) soil: u32,
    pub(super) brass: u32,
    pub(super) copper: u32,
    pub(super) glaze: u32,
    pub(super) water: u32,
    pub(super) iron: u32,
    pub(super) lamp: u32,
}

/// Radiance of a lantern's pane, W/(sr m²): a few times that of plaster in the sun.
const LAMP: Vec3 = Vec3::new(9.0, 5.2, 2.0);

/// Adds all materials and their pictures to `scene`.
pub(super) fn palette(scene: &mut Scene) -> Palette {
    let mut shelf = Shelf { scene };
    let tile = |metres: f32| Affine2::from_scale(Vec2::splat(1.0 / metres));
    let once = Affine2::IDENTITY;

    let plaster = shelf.picture(paint::paint("plaster", [512; 2], paint::plaster), tile(3.0));
    let limestone = shelf.picture(
        paint::paint("limestone", [512; 2], paint::limestone),
        tile(1.5),
    );
    let blocks = shelf.picture(paint::paint("blocks", [512; 2], paint::blocks), tile(1.8));
    let blocks_normal = shelf.picture(
        paint::normal_map("blocks normal", 512, paint::blocks_height),
        tile(1.8),
    );
    let bricks = shelf.picture(paint::paint("bricks", [512; 2], paint::bricks), tile(1.0));
    let bricks_normal = shelf.picture(
        paint::normal_map("bricks normal", 512, paint::bricks_height),
        tile(1.0),
    );
    let voussoirs = shelf.picture(paint::paint("voussoirs", [256; 2], paint::voussoirs), once);
    let court = shelf.picture(
        paint::paint("court", [512; 2], paint::court_tiles),
        tile(1.0),
    );
    let court_polish = shelf.picture(
        paint::paint("court polish", [256; 2], paint::court_polish),
        tile(1.0),
    );
    let azulejo = shelf.picture(paint::paint("azulejo", [256; 2], paint::azulejo), tile(0.4));
    let wood = shelf.picture(paint::paint("wood", [256; 2], paint::wood), tile(0.8));
    let grounds = [
        ("crimson", vec3(0.62, 0.12, 0.14)),
        ("teal", vec3(0.05, 0.38, 0.40)),
        ("indigo", vec3(0.15, 0.17, 0.42)),
    ];

    Palette {
        plaster: shelf.add("plaster", rough(plaster, 0.95)),
        limestone: shelf.add("limestone", rough(limestone, 0.8)),
        blocks: shelf.add(
            "blocks",
            Material {
                normal_texture: Some(blocks_normal),
                ..rough(blocks, 0.85)
            },
        ),
        bricks: shelf.add(
            "bricks",
            Material {
                normal_texture: Some(bricks_normal),
                ..rough(bricks, 0.7)
            },
        ),
        voussoirs: shelf.add("voussoirs", rough(voussoirs, 0.85)),
        court: shelf.add(
            "court",
            Material {
                metallic_roughness_texture: Some(court_polish),
                roughness: 1.0,
                ..rough(court, 1.0)
            },
        ),
        azulejo: shelf.add("azulejo", rough(azulejo, 0.22)),
        wood: shelf.add("wood", rough(wood, 0.75)),
        door: shelf.add(
            "door",
            Material {
                base_color: vec3(0.42, 0.72, 0.72).extend(1.0),
                ..rough(wood, 0.6)
            },
        ),
        roof: shelf.add("roof", plain(vec3(0.50, 0.21, 0.12), 0.9)),
        banners: grounds.map(|(name, ground)| {
            let cloth = paint::paint(name, [128, 384], |p| paint::banner(p, ground));
            let cloth = TextureRef {
                wrap: [Wrap::Clamp; 2],
                ..shelf.picture(cloth, once)
            };
            shelf.add(
                name,
                Material {
                    double_sided: true,
                    ..rough(cloth, 0.9)
                },
            )
        }),
        orange_tree: shelf.foliage("orange tree", vec3(0.93, 0.52, 0.10)),
        bougainvillea: shelf.foliage("bougainvillea", vec3(0.80, 0.16, 0.45)),
        clay: shelf.add("clay", plain(vec3(0.55, 0.25, 0.15), 0.8)),
        soil: shelf.add("soil", plain(vec3(0.10, 0.07, 0.05), 1.0)),
        brass: shelf.add("brass", metal(vec3(0.89, 0.68, 0.32), 0.18)),
        copper: shelf.add("copper", metal(vec3(0.93, 0.58, 0.45), 0.28)),
        glaze: shelf.add("glaze", plain(vec3(0.03, 0.12, 0.34), 0.08)),
        water: shelf.add(
            "water",
            Material {
                ior: 1.33,
                ..plain(vec3(0.03, 0.10, 0.11), 0.03)
            },
        ),
        iron: shelf.add("iron", metal(vec3(0.22, 0.20, 0.19), 0.45)),
        lamp: shelf.add(
            "lamp",
            Material {
                emissive: LAMP,
                ..plain(vec3(0.8, 0.6, 0.35), 0.6)
            },
        ),
    }
}

struct Shelf<'a> {
    scene: &'a mut Scene,
}

impl Shelf<'_> {
    fn picture(&mut self, image: Image, transform: Affine2) -> TextureRef {
        self.scene.images.push(image);
        TextureRef {
            image: self.scene.images.len() as u32 - 1,
            uv_set: 0,
            transform,
            wrap: [Wrap::Repeat; 2],
            linear: true,
        }
    }

    fn add(&mut self, name: &str, material: Material) -> u32 {
        self.scene.materials.push(Material {
            name: name.to_owned(),
            ..material
        });
        self.scene.materials.len() as u32 - 1
    }

    fn foliage(&mut self, name: &str, fruit: Vec3) -> u32 {
        let image = paint::paint(name, [256; 2], |p| paint::leaves(p, fruit));
        let leaves = TextureRef {
            wrap: [Wrap::Clamp; 2],
            ..self.picture(image, Affine2::IDENTITY)
        };
        self.add(
            name,
            Material {
                alpha: Alpha::Mask { cutoff: 0.5 },
                double_sided: true,
                ..rough(leaves, 0.7)
            },
        )
    }
}

fn rough(texture: TextureRef, roughness: f32) -> Material {
    Material {
        base_color_texture: Some(texture),
        ..plain(Vec3::ONE, roughness)
    }
}

fn plain(color: Vec3, roughness: f32) -> Material {
    Material {
        base_color: color.extend(1.0),
        metallic: 0.0,
        roughness,
        ..Material::default()
    }
}

fn metal(color: Vec3, roughness: f32) -> Material {
    Material {
        base_color: Vec4::from((color, 1.0)),
        metallic: 1.0,
        roughness,
        ..Material::default()
    }
}
