//! A viewer's lenses and a phone's screen behind them.
//!
//! Everything is told in tangents of angles at a lens, from its axis: a point of
//! the screen at distance `x` from the axis is at `x / screen_to_lens`, and the
//! lens shows it at `r (1 + k[0] r² + k[1] r⁴)`. So a picture that is drawn for
//! the eye is bent by the very polynomial, and a viewer differs from another by
//! five lengths and numbers (as in Cardboard's device parameters).

use serde::{Deserialize, Serialize};
use shadecast_protocol::{EyeView, Fov, Pose};
use thiserror::Error;

use super::EyeLens;

/// Metres.
const INCH: f32 = 0.0254;
/// Between the tray and the first row of a phone's screen, metres.
const BORDER: f32 = 0.003;

/// A viewer that holds a phone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Optics {
    /// Between the axes of both lenses, metres.
    pub between_lenses: f32,
    /// From the screen to a lens, metres.
    pub screen_to_lens: f32,
    /// From the tray that the phone stands on up to the axes, metres.
    pub tray_to_lens: f32,
    /// What a lens shows to each side of its axis at most, degrees.
    pub half_fov: f32,
    /// How it bends.
    pub k: [f32; 2],
}

/// A phone's screen, as it lies in a viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhoneScreen {
    /// How dense its pixels are, to the right and down.
    pub pixels_an_inch: [f32; 2],
    /// Pictures that it shows a second.
    pub rate: f32,
    /// Quarters by which it shows them turned, as Android counts: 1 is a phone that
    /// was turned to the left.
    pub quarters: u8,
}

/// Why a viewer or a screen is refused.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum OpticsError {
    /// Out of what can be worn.
    #[error("{what} of the viewer is {value}, and must lie between {low} and {high}")]
    Range {
        /// Which number.
        what: &'static str,
        /// As it is.
        value: f32,
        /// The least.
        low: f32,
        /// The most.
        high: f32,
    },
    /// The axes do not meet the screen.
    #[error(
        "a screen of {:.0}x{:.0} mm does not fit behind the lenses of the viewer",
        .0[0] * 1e3, .0[1] * 1e3
    )]
    Screen([f32; 2]),
}

/// What is drawn for each eye, and how it is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eyes {
    /// Where the eyes are in the head, and what they see.
    pub views: [EyeView; 2],
    /// The lenses before them.
    pub lenses: [EyeLens; 2],
    /// Pixels of a picture that has as many as the screen in the middle.
    pub size: [u32; 2],
}

/// Largest side of an eye's picture, pixels.
const LARGEST: f32 = 2048.0;

impl Optics {
    /// Google's Cardboard of 2015, whose lenses most viewers of its kind have.
    ///
    /// Source: the device parameters that Google published for it.
    pub const CARDBOARD: Self = Self {
        between_lenses: 0.064,
        screen_to_lens: 0.039,
        tray_to_lens: 0.035,
        half_fov: 60.0,
        k: [0.34, 0.55],
    };

    /// The viewer, if one can be worn.
    ///
    /// # Errors
    /// When a number is far from any viewer, or not one.
    pub fn checked(self) -> Result<Self, OpticsError> {
        let [k0, k1] = self.k;
        for (what, value, low, high) in [
            ("between_lenses", self.between_lenses, 0.03, 0.1),
            ("screen_to_lens", self.screen_to_lens, 0.01, 0.2),
            ("tray_to_lens", self.tray_to_lens, 0.01, 0.1),
            ("half_fov", self.half_fov, 10.0, 80.0),
            ("k[0]", k0, 0.0, 4.0),
            ("k[1]", k1, 0.0, 4.0),
        ] {
            // NaN lies in no range.
            if !(low..=high).contains(&value) {
                return Err(OpticsError::Range {
                    what,
                    value,
                    low,
                    high,
                });
            }
        }
        Ok(self)
    }

    /// What both eyes see of so many pixels of a screen through the lenses.
    ///
    /// # Errors
    /// When the axes do not meet the screen.
    pub fn eyes(self, size: [u32; 2], screen: PhoneScreen) -> Result<Eyes, OpticsError> {
        let Self {
            screen_to_lens,
            k: [k0, k1],
            ..
        } = self;
        let a_metre = screen.pixels_an_inch.map(|an_inch| an_inch / INCH);
        let metres = [0, 1].map(|axis| size[axis] as f32 / a_metre[axis]);
        let [width, height] = metres;
        let inner = self.between_lenses * 0.5;
        let below = self.tray_to_lens - BORDER;
        // Of the left eye, whose half ends in the middle of the screen.
        let display = [inner - width * 0.5, inner, height - below, -below]
            .map(|metres| metres / screen_to_lens);
        let [left, right, up, down] = display;
        // An endless or empty screen is none either.
        let meets = left < 0.0 && right > 0.0 && up > 0.0 && down < 0.0;
        if !meets || !left.is_finite() || !up.is_finite() {
            return Err(OpticsError::Screen(metres));
        }
        let widest = self.half_fov.to_radians().tan();
        let seen = |r: f32| {
            let r2 = r * r;
            (r * (1.0 + r2 * (k0 + r2 * k1))).clamp(-widest, widest)
        };
        let picture = display.map(seen);
        let [left, right, up, down] = picture;
        let fov = Fov {
            left: left.atan(),
            right: right.atan(),
            up: up.atan(),
            down: down.atan(),
        };
        let lens = EyeLens {
            display,
            picture,
            k: [self.k; 3],
        };
        let mut at = Pose::IDENTITY;
        at.position.x = -inner;
        let view = EyeView {
            head_from_eye: at,
            fov,
        };
        let mut other = view;
        other.head_from_eye.position.x = inner;
        (other.fov.left, other.fov.right) = (-fov.right, -fov.left);
        let pixels = |extent: f32, along: usize| {
            (extent * a_metre[along] * screen_to_lens).clamp(1.0, LARGEST) as u32
        };
        Ok(Eyes {
            views: [view, other],
            lenses: [lens, lens.mirrored()],
            size: [pixels(right - left, 0), pixels(up - down, 1)],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 151 by 68 mm.
    const SIZE: [u32; 2] = [2400, 1080];
    const PHONE: PhoneScreen = PhoneScreen {
        pixels_an_inch: [2400.0 / 0.151 * INCH, 1080.0 / 0.068 * INCH],
        rate: 60.0,
        quarters: 1,
    };

    #[test]
    fn the_eyes_see_as_much_as_lens_and_screen_allow() {
        let eyes = Optics::CARDBOARD.eyes(SIZE, PHONE).expect("it fits");
        let [left, right] = eyes.views.map(|view| view.fov);
        // Outwards the lens ends first, inwards the screen: r = 32 / 39 mm.
        assert!((left.left.to_degrees() + 60.0).abs() < 1e-3, "{left:?}");
        let r: f32 = 32.0 / 39.0;
        let bent = r * (1.0 + 0.34 * r.powi(2) + 0.55 * r.powi(4));
        assert!((left.right.tan() - bent).abs() < 1e-5, "{left:?}");
        assert!((left.down.tan() + bent).abs() < 1e-5, "{left:?}");
        assert_eq!([right.left, right.right], [-left.right, -left.left]);
        assert_eq!([right.up, right.down], [left.up, left.down]);
        let [one, two] = eyes.views.map(|view| view.head_from_eye.position.x);
        assert!((two - one - 0.064).abs() < 1e-6);
        // 15.9 pixels a millimetre at 39 mm.
        let wide = (left.right.tan() - left.left.tan()) * 2400.0 / 151.0 * 39.0;
        assert!((eyes.size[0] as f32 - wide).abs() < 2.0, "{:?}", eyes.size);
    }

    #[test]
    fn what_lies_on_an_axis_is_drawn_there() {
        let eyes = Optics::CARDBOARD.eyes(SIZE, PHONE).expect("it fits");
        for lens in eyes.lenses {
            let [left, right, up, down] = lens.display;
            assert!(left < 0.0 && right > 0.0 && up > 0.0 && down < 0.0);
            // Both halves together are the screen.
            assert!(((right - left) * 0.039 * 2.0 - 0.151).abs() < 1e-6);
            assert!(((up - down) * 0.039 - 0.068).abs() < 1e-6);
        }
    }

    #[test]
    fn viewers_and_screens_that_cannot_be_are_refused() {
        let good = Optics::CARDBOARD;
        for bad in [
            Optics {
                screen_to_lens: 0.0,
                ..good
            },
            Optics {
                half_fov: 90.0,
                ..good
            },
            Optics {
                k: [f32::NAN, 0.0],
                ..good
            },
            Optics {
                between_lenses: f32::INFINITY,
                ..good
            },
        ] {
            let error = bad.checked().unwrap_err().to_string();
            assert!(error.contains("of the viewer is"), "{error}");
        }
        for size in [[800, 500], [900, 1080], [0, 1080], [2400, 0], [2400, 100]] {
            let error = good.eyes(size, PHONE).unwrap_err().to_string();
            assert!(error.contains("does not fit"), "{size:?}: {error}");
        }
        for dense in [0.0, -400.0, f32::NAN, f32::INFINITY] {
            let screen = PhoneScreen {
                pixels_an_inch: [dense; 2],
                ..PHONE
            };
            assert!(good.eyes(SIZE, screen).is_err(), "{dense}");
        }
    }
}
