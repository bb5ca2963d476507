//! `shadecast inspect`: what a scene holds, for people and for programs.

use std::fmt::Write;

use glam::Vec3;
use serde::Serialize;

use super::{Corner, Light, Scene, SceneFacts, Triangle};

/// What there is to say about a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Inspection {
    /// The scene's name.
    pub name: String,
    /// Triangles.
    pub triangles: usize,
    /// Welded positions.
    pub positions: usize,
    /// Corners: positions with attributes.
    pub corners: usize,
    /// Materials.
    pub materials: usize,
    /// Pictures.
    pub images: usize,
    /// Width and height of every picture, pixels.
    pub image_sizes: Vec<[u32; 2]>,
    /// Lowest coordinates at time zero, metres.
    pub lowest: [f32; 3],
    /// Highest coordinates at time zero, metres.
    pub highest: [f32; 3],
    /// Names of the moving objects.
    pub moving: Vec<String>,
    /// One line for every light but the sky.
    pub lights: Vec<String>,
    /// Bytes in main memory.
    pub memory: Memory,
    /// Extensions that are honoured.
    pub extensions_used: Vec<String>,
    /// Extensions that are not.
    pub extensions_ignored: Vec<String>,
    /// What loading warned of.
    pub warnings: Vec<String>,
    /// What the scene uses.
    pub facts: SceneFacts,
    /// What the server leaves out for it.
    pub left_out: Vec<String>,
}

/// Bytes that a scene takes in main memory.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Memory {
    /// Of the triangles.
    pub triangles: usize,
    /// Of positions and corners.
    pub vertices: usize,
    /// Of decoded pictures.
    pub images: usize,
}

impl Inspection {
    /// Inspects a scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let facts = SceneFacts::of(scene);
        let (lowest, highest) = scene.bounds();
        Self {
            name: scene.name.clone(),
            triangles: scene.triangles.len(),
            positions: scene.positions.len(),
            corners: scene.corners.len(),
            materials: scene.materials.len(),
            images: scene.images.len(),
            image_sizes: scene.images.iter().map(|i| [i.width, i.height]).collect(),
            lowest: lowest.to_array(),
            highest: highest.to_array(),
            moving: scene
                .objects
                .iter()
                .map(|object| object.name.clone())
                .collect(),
            lights: scene.lights.iter().map(describe).collect(),
            memory: Memory {
                triangles: size_of::<Triangle>() * scene.triangles.len(),
                vertices: size_of::<Vec3>() * scene.positions.len()
                    + size_of::<Corner>() * scene.corners.len(),
                images: scene.images.iter().map(|image| image.rgba.len()).sum(),
            },
            extensions_used: scene.notes.extensions_used.clone(),
            extensions_ignored: scene.notes.extensions_ignored.clone(),
            warnings: scene.notes.warnings.clone(),
            left_out: facts.left_out(),
            facts,
        }
    }
}

fn describe(light: &Light) -> String {
    let reach = |range: f32| {
        if range.is_finite() {
            format!(", reaches {range:.1} m")
        } else {
            String::new()
        }
    };
    match light {
        Light::Point {
            position,
            intensity,
            range,
        } => format!(
            "point at {position:.2}, {intensity:.2} W/sr{}",
            reach(*range)
        ),
        Light::Spot {
            position,
            direction,
            intensity,
            range,
            outer,
            ..
        } => format!(
            "spot at {position:.2} along {direction:.2}, {intensity:.2} W/sr, {:.0} degrees{}",
            2.0 * outer.to_degrees(),
            reach(*range)
        ),
        Light::Directional {
            direction,
            irradiance,
            angular_radius,
        } => format!(
            "sun along {direction:.2}, {irradiance:.2} W/m2, {:.2} degrees wide",
            2.0 * angular_radius.to_degrees()
        ),
    }
}

/// The report as text.
#[must_use]
pub fn inspection(scene: &Scene) -> String {
    let report = Inspection::of(scene);
    let size = Vec3::from_array(report.highest) - Vec3::from_array(report.lowest);
    let kib = |bytes: usize| format!("{} KiB", bytes.div_ceil(1024));
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{name:<20} {value}");
    };
    line("scene", report.name);
    line("triangles", report.triangles.to_string());
    line("positions", report.positions.to_string());
    line("corners", report.corners.to_string());
    line("materials", report.materials.to_string());
    line("images", report.images.to_string());
    line(
        "emissive triangles",
        report.facts.emissive_triangles.to_string(),
    );
    line(
        "size",
        format!("{:.2} x {:.2} x {:.2} m", size.x, size.y, size.z),
    );
    line(
        "bounds",
        format!("{:.2?} to {:.2?}", report.lowest, report.highest),
    );
    line("memory, triangles", kib(report.memory.triangles));
    line("memory, vertices", kib(report.memory.vertices));
    line("memory, images", kib(report.memory.images));
    let lists = [
        ("moving object", report.moving),
        ("light", report.lights),
        ("extension used", report.extensions_used),
        ("extension ignored", report.extensions_ignored),
        ("warning", report.warnings),
        ("left out", report.left_out),
    ];
    for (name, entries) in lists {
        for entry in entries {
            line(name, entry);
        }
    }
    text
}
