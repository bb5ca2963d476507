//! A small, calm panel of text that hangs in the world, for whoever wears a
//! headset and sees no terminal.
//!
//! It appears ahead of the head, a little below the eyes, and stays where it
//! appeared. The text becomes a picture when it changes, and is a textured
//! rectangle in every other frame.

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};
use glam::{Mat4, Quat, Vec3};
use shadecast_protocol::Pose;

use super::{EyeCamera, backdrop, pipelines::Pipelines};

/// Pixels of a line of text; at the panel's scale its letters are 1.5° high.
const LINE: f32 = 44.0;
/// Pixels around the text.
const MARGIN: f32 = 36.0;
/// Radius of the panel's corners, pixels.
const CORNER: f32 = 28.0;
/// Metres a pixel.
const SCALE: f32 = 0.000_75;
/// Longest line, in letters.
const LINE_LETTERS: usize = 44;
/// Most letters of a text; what is beyond is left out.
const LETTERS: usize = 400;
/// From the eyes, metres: where the eyes of headsets focus.
const DISTANCE: f32 = 1.3;
/// Below the eyes, metres.
const BELOW: f32 = 0.22;
/// Display-encoded, with how much of the world it covers.
const PANEL: [f32; 4] = [22.0, 25.0, 31.0, 0.82];
const TEXT: [f32; 3] = [226.0, 229.0, 233.0];

/// The panel that is shown.
#[derive(Debug)]
pub(super) struct NoticePass {
    text: String,
    pipeline: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
    /// Metres.
    half_size: [f32; 2],
    /// None until the next frame is drawn.
    world_from_panel: Option<Pose>,
}

impl NoticePass {
    /// `text` as a panel, at the place of the one `before`.
    pub(super) fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        pipelines: &Pipelines,
        eye_format: wgpu::TextureFormat,
        text: &str,
        before: Option<&Self>,
    ) -> Self {
        let picture = Picture::of(text);
        let group = backdrop::Picture {
            label: "notice",
            size: [picture.width, picture.height],
            rgba: &picture.rgba,
            sideways: wgpu::AddressMode::ClampToEdge,
        }
        .bind(device, queue, eye_format, &pipelines.layouts().notice, 4);
        Self {
            text: text.to_owned(),
            pipeline: pipelines.build_notice(device),
            group,
            half_size: [picture.width, picture.height].map(|side| side as f32 * 0.5 * SCALE),
            world_from_panel: before.and_then(|before| before.world_from_panel),
        }
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }

    /// Hangs it ahead of these eyes, unless it hangs already.
    pub(super) fn place(&mut self, cameras: [EyeCamera; 2]) {
        self.world_from_panel
            .get_or_insert_with(|| ahead_of(cameras.map(|eye| eye.world_from_eye)));
    }

    /// Draws over what is there.
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, clip_from_world: [Mat4; 2]) {
        let Some(world_from_panel) = self.world_from_panel else {
            return;
        };
        let [x, y] = self.half_size;
        let world_from_square = world_from_panel.matrix() * Mat4::from_scale(Vec3::new(x, y, 1.0));
        let clip_from_square = clip_from_world.map(|clip| clip * world_from_square);
        pass.set_pipeline(&self.pipeline);
        pass.set_immediates(0, bytemuck::bytes_of(&clip_from_square));
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..4, 0..1);
    }
}

/// Upright, facing the eyes.
fn ahead_of([left, right]: [Pose; 2]) -> Pose {
    let eyes = (left.position + right.position) * 0.5;
    let looks = left.orientation * Vec3::NEG_Z;
    // Straight up or down, any direction is as good as another.
    let ahead = Vec3::new(looks.x, 0.0, looks.z)
        .try_normalize()
        .unwrap_or(Vec3::NEG_Z);
    Pose {
        position: eyes + ahead * DISTANCE - Vec3::Y * BELOW,
        orientation: Quat::from_rotation_arc(Vec3::Z, -ahead),
    }
}

/// RGBA8, row by row from the top.
struct Picture {
    width: u32,
    height: u32,
    rgba: Vec<u8>,
}

impl Picture {
    fn of(text: &str) -> Self {
        let font = FontRef::try_from_slice(epaint_default_fonts::UBUNTU_LIGHT)
            .expect("the font is a part of the program");
        let font = font.as_scaled(PxScale::from(LINE));
        let lines = lines(text);
        let advance = |letter: char| font.h_advance(font.glyph_id(letter));
        let line_width = |line: &String| line.chars().map(advance).sum::<f32>();
        let widest = lines.iter().map(line_width).fold(0.0, f32::max);
        let width = (widest + 2.0 * MARGIN).ceil();
        let height = (lines.len() as f32 * LINE * 1.2 + 2.0 * MARGIN).ceil();
        let mut picture = Self::panel(width as u32, height as u32);
        for (row, line) in lines.iter().enumerate() {
            let mut x = (width - line_width(line)) * 0.5;
            let baseline = MARGIN + row as f32 * LINE * 1.2 + font.ascent();
            for letter in line.chars() {
                let glyph = font
                    .glyph_id(letter)
                    .with_scale_and_position(PxScale::from(LINE), point(x, baseline));
                x += advance(letter);
                if let Some(outline) = font.outline_glyph(glyph) {
                    let corner = outline.px_bounds().min;
                    outline.draw(|right, down, coverage| {
                        picture.ink(
                            corner.x as i32 + right as i32,
                            corner.y as i32 + down as i32,
                            coverage,
                        );
                    });
                }
            }
        }
        picture
    }

    /// An empty panel with round corners.
    fn panel(width: u32, height: u32) -> Self {
        let [red, green, blue, cover] = PANEL;
        let mut rgba = Vec::with_capacity((width * height * 4) as usize);
        for y in 0..height {
            for x in 0..width {
                // Distance from the rectangle that the corners are circles about.
                let outside = |at: u32, side: u32| {
                    let at = at as f32 + 0.5;
                    (CORNER - at).max(at - (side as f32 - CORNER)).max(0.0)
                };
                let distance = outside(x, width).hypot(outside(y, height));
                let inside = (CORNER - distance + 0.5).clamp(0.0, 1.0);
                let alpha = cover * inside * 255.0;
                rgba.extend([red, green, blue, alpha].map(|value| value as u8));
            }
        }
        Self {
            width,
            height,
            rgba,
        }
    }

    /// Covers a pixel with the colour of text.
    fn ink(&mut self, x: i32, y: i32, coverage: f32) {
        let inside = (0..self.width as i32).contains(&x) && (0..self.height as i32).contains(&y);
        if !inside {
            return;
        }
        let first = (y as usize * self.width as usize + x as usize) * 4;
        let pixel = &mut self.rgba[first..first + 4];
        let coverage = coverage.clamp(0.0, 1.0);
        for (value, text) in pixel.iter_mut().zip([TEXT[0], TEXT[1], TEXT[2], 255.0]) {
            *value = (f32::from(*value) * (1.0 - coverage) + text * coverage) as u8;
        }
    }
}

/// The text in lines that are not too long, broken between words where there
/// are any.
fn lines(text: &str) -> Vec<String> {
    let text: String = text
        .chars()
        .take(LETTERS)
        .map(|letter| if letter.is_control() { ' ' } else { letter })
        .collect();
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let letters: Vec<char> = word.chars().collect();
        for piece in letters.chunks(LINE_LETTERS) {
            let line = lines.last_mut().expect("there is always a line");
            if line.is_empty() {
                line.extend(piece);
            } else if line.chars().count() + 1 + piece.len() <= LINE_LETTERS {
                line.push(' ');
                line.extend(piece);
            } else {
                lines.push(piece.iter().collect());
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_broken_between_words_and_long_words_anywhere() {
        assert_eq!(
            lines("Connecting to the server"),
            ["Connecting to the server"]
        );
        let long = lines(&"word ".repeat(20));
        assert_eq!(long.len(), 3);
        assert!(long.iter().all(|line| line.len() <= LINE_LETTERS));
        assert_eq!(lines(&"x".repeat(100)).len(), 3);
        assert_eq!(lines(""), [""]);
        let endless = lines(&"a\nb ".repeat(10_000));
        assert!(endless.len() <= LETTERS / 2, "{}", endless.len());
    }

    #[test]
    fn text_is_lighter_than_its_panel_and_corners_are_clear() {
        let picture = Picture::of("Connecting");
        let at = |x: u32, y: u32| {
            let first = ((y * picture.width + x) * 4) as usize;
            [0, 1, 2, 3].map(|channel: usize| picture.rgba[first + channel])
        };
        assert_eq!(at(0, 0)[3], 0, "the corner is clear");
        assert!(at(picture.width / 2, 4)[3] > 150, "the panel is not");
        let inked = picture.rgba.chunks_exact(4).filter(|pixel| pixel[0] > 150);
        let share = inked.count() as f32 / (picture.width * picture.height) as f32;
        assert!((0.02..0.3).contains(&share), "{share}");
    }

    #[test]
    fn a_panel_hangs_upright_ahead_of_whoever_looks_down() {
        let looks_down = Pose {
            position: Vec3::new(1.0, 1.6, 2.0),
            orientation: Quat::from_rotation_y(0.7) * Quat::from_rotation_x(-0.5),
        };
        let panel = ahead_of([looks_down; 2]);
        let up = panel.orientation * Vec3::Y;
        assert!((up - Vec3::Y).length() < 1e-4, "{up}");
        let towards = (looks_down.position - panel.position)
            .with_y(0.0)
            .normalize();
        assert!((panel.orientation * Vec3::Z - towards).length() < 1e-4);
        assert!(panel.position.y < 1.6);
        for orientation in [
            Quat::from_rotation_x(1.5707964),
            Quat::from_rotation_y(std::f32::consts::PI),
        ] {
            let pose = Pose {
                orientation,
                ..looks_down
            };
            assert!(ahead_of([pose; 2]).is_valid());
        }
    }
}
