//! The twin of all kernels that pack: one call a frame.

use std::collections::BTreeMap;

use super::{ActiveTriangle, CLASSES, NONE, Shape, TssParameters, status};

/// Sides in texels' distances by class: powers of two and three steps between.
const SPANS: [u32; CLASSES] = [
    1, 1, 1, 2, 2, 2, 3, 3, 4, 5, 6, 7, 8, 10, 11, 13, 16, 19, 23, 27, 32, 38, 45, 54, 64, 76, 91,
    108, 128, 152, 181, 215,
];
/// A triangle is slanted where its longest edge is four times its height, steps.
const SLANTED: u32 = 2 * 256;
/// Powers of 2 to the minus sixteenths, in 65535ths.
const WEIGHTS: [u32; 16] = [
    65535, 62757, 60096, 57548, 55108, 52772, 50534, 48392, 46340, 44376, 42494, 40693, 38967,
    37315, 35733, 34218,
];

/// Kind of a triangle's rectangle: classes of its height and width. Equal ones are
/// L-packed, two to a rectangle; others are wider than high, one to a rectangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Class {
    /// Of the height.
    pub height: u32,
    /// Of the width, at least that of the height.
    pub width: u32,
}

impl Class {
    /// What a triangle of this shape deserves, with no side above `most`.
    #[must_use]
    pub fn of(shape: Shape, most: u32) -> Self {
        let (width, height) = (u32::from(shape.width), u32::from(shape.height));
        let class = |steps: u32| ((steps + 32) >> 6).min(CLASSES as u32 - 1).min(most);
        if width >= height + SLANTED {
            return Self {
                height: class(height),
                width: class(width),
            };
        }
        // Right angles of this leg have as many samples as the triangle has pixels.
        let leg = class((width + height) >> 1);
        Self {
            height: leg,
            width: leg,
        }
    }

    /// The class so many steps smaller.
    #[must_use]
    pub fn scaled(self, steps: u32) -> Self {
        Self {
            height: self.height.saturating_sub(steps),
            width: self.width.saturating_sub(steps),
        }
    }

    fn is_paired(self) -> bool {
        self.width == self.height
    }

    /// Triangles in a rectangle.
    fn per_rectangle(self) -> u32 {
        1 + u32::from(self.is_paired())
    }

    /// Width and height of a rectangle in texels.
    #[must_use]
    pub fn rectangle(self) -> (u32, u32) {
        let (width, height) = (SPANS[self.width as usize], SPANS[self.height as usize]);
        match (self.is_paired(), width) {
            // Two right angles and the diagonals that lookups between them need.
            (true, 1) => (4, 2),
            (true, _) => (width + 4, height + 1),
            (false, _) => (width + 1, height + 1),
        }
    }

    /// The largest class of sides that fit a quarter of an atlas of this side.
    #[must_use]
    pub fn most(side: u32) -> u32 {
        let fits = |class: &u32| 4 * (SPANS[*class as usize] + 4) <= side.max(20);
        (0..CLASSES as u32).rev().find(fits).unwrap_or(0)
    }
}

/// A visible triangle, by ascending patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeenTriangle {
    /// Which patch.
    pub patch: u32,
    /// That it covers; at least 1.
    pub pixels: u32,
}

/// What a frame leaves.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// By ascending patch: all that are visible or just were.
    pub active: Vec<ActiveTriangle>,
    /// Visible triangles.
    pub seen: u32,
    /// Steps by which all sides are scaled down, quarters of an octave.
    pub steps: u32,
    /// See [`status`].
    pub status: u32,
    /// Texels of all rectangles in use.
    pub used_texels: u32,
}

/// Who was visible when.
#[derive(Clone, Debug, Default)]
pub struct Packer {
    /// Frames for which a triangle has not been visible.
    ages: BTreeMap<u32, u32>,
}

impl Packer {
    /// Places a frame. `shape_of` is asked for all that are visible or just were.
    pub fn place(
        &mut self,
        parameters: &TssParameters,
        seen: &[SeenTriangle],
        shape_of: impl Fn(u32) -> Shape,
    ) -> Outcome {
        self.ages.retain(|_, age| {
            *age += 1;
            *age <= parameters.keep_unseen
        });
        self.ages.extend(seen.iter().map(|seen| (seen.patch, 0)));
        let mut pixels = seen.iter().peekable();
        let active: Vec<(ActiveTriangle, Shape)> = (self.ages.keys())
            .map(|&patch_id| {
                let seen = pixels.next_if(|seen| seen.patch == patch_id);
                let triangle = ActiveTriangle {
                    patch_id,
                    pixels: seen.map_or(0, |seen| seen.pixels),
                    corners: [NONE; 3],
                    weights: [0; 2],
                };
                (triangle, shape_of(patch_id))
            })
            .collect();

        let mut tally = [[0; CLASSES * CLASSES]; 2];
        for (triangle, shape) in &active {
            let Class { height, width } = Class::of(*shape, parameters.most_class);
            let cell = (height as usize) * CLASSES + width as usize;
            tally[0][cell] += u32::from(triangle.pixels > 0);
            tally[1][cell] += 1;
        }
        let [of_seen, of_all] = tally.map(|tally| {
            let fits = |steps: &u32| Shelves::walk(parameters, &tally, *steps).fits;
            (0..CLASSES as u32).find(fits)
        });
        let steps = of_seen.unwrap_or(CLASSES as u32 - 1);
        // Also where not even the smallest of all fit.
        let evict = of_all.is_none_or(|of_all| of_all > steps);
        let shelves = Shelves::walk(parameters, &tally[usize::from(!evict)], steps);

        let mut outcome = Outcome {
            active: active.iter().map(|(triangle, _)| *triangle).collect(),
            seen: seen.len() as u32,
            steps,
            status: 0,
            used_texels: shelves.used_texels,
        };
        if !shelves.fits {
            outcome.status |= status::OVERFULL;
        }
        let mut ranks: BTreeMap<Class, u32> = BTreeMap::new();
        for ((triangle, shape), after) in active.iter().zip(&mut outcome.active) {
            if evict && triangle.pixels == 0 {
                outcome.status |= status::EVICTED;
                continue;
            }
            let class = Class::of(*shape, parameters.most_class).scaled(steps);
            let rank = ranks.entry(class).or_default();
            if let Some(corners) = shelves.corners(parameters, class, *rank, *shape) {
                after.corners = corners;
                after.weights = weights(*shape);
            }
            *rank += 1;
        }
        outcome
    }
}

/// Where the rectangles of each kind lie.
struct Shelves {
    places: Vec<Place>,
    fits: bool,
    used_texels: u32,
}

#[derive(Clone, Copy, Default)]
struct Place {
    in_shelf: u32,
    first: [u32; 2],
    next_y: u32,
}

impl Shelves {
    /// Fills shelves with rectangles, highest first: next fit, decreasing height.
    fn walk(parameters: &TssParameters, tally: &[u32; CLASSES * CLASSES], steps: u32) -> Self {
        let mut counts = [0; CLASSES * CLASSES];
        for (cell, count) in tally.iter().enumerate() {
            let class = Class {
                height: (cell / CLASSES) as u32,
                width: (cell % CLASSES) as u32,
            };
            let Class { height, width } = class.scaled(steps);
            counts[height as usize * CLASSES + width as usize] += count;
        }
        let mut shelves = Self {
            places: vec![Place::default(); CLASSES * CLASSES],
            fits: true,
            used_texels: 0,
        };
        let (mut x, mut y, mut shelf_height) = (parameters.width, 0, 0);
        for cell in (0..CLASSES * CLASSES).rev() {
            let class = Class {
                height: (cell / CLASSES) as u32,
                width: (cell % CLASSES) as u32,
            };
            let count = counts[cell];
            if count == 0 {
                continue;
            }
            let (width, height) = class.rectangle();
            let rectangles = count.div_ceil(class.per_rectangle());
            let in_shelf = rectangles.min((parameters.width - x) / width);
            let place = &mut shelves.places[cell];
            place.in_shelf = in_shelf;
            place.first = [x, y];
            x += in_shelf * width;
            let rest = rectangles - in_shelf;
            if rest > 0 {
                y += shelf_height;
                shelf_height = height;
                place.next_y = y;
                let per_shelf = parameters.width / width;
                let more = (rest - 1) / per_shelf;
                y += more * height;
                x = (rest - more * per_shelf) * width;
            }
            shelves.used_texels += rectangles * width * height;
        }
        shelves.fits = y + shelf_height <= parameters.height;
        shelves
    }

    /// Corners of the slot of a kind's triangle with this rank, if there is room.
    fn corners(
        &self,
        parameters: &TssParameters,
        class: Class,
        rank: u32,
        shape: Shape,
    ) -> Option<[u32; 3]> {
        let place = self.places[class.height as usize * CLASSES + class.width as usize];
        let (width, height) = class.rectangle();
        let index = rank / class.per_rectangle();
        let [x, y] = if index < place.in_shelf {
            [place.first[0] + index * width, place.first[1]]
        } else {
            let per_shelf = parameters.width / width;
            let rest = index - place.in_shelf;
            let down = rest / per_shelf * height;
            [rest % per_shelf * width, place.next_y + down]
        };
        if y + height > parameters.height {
            return None;
        }
        let middle = |x: u32, y: u32| (8 * x + 4) + ((8 * y + 4) << 16);
        let span = SPANS[class.width as usize];
        if class.is_paired() {
            let second = rank % 2 == 1;
            return Some(if second {
                let (x, y) = (x + width - 1, y + height - 1);
                [middle(x, y), middle(x - span, y), middle(x, y - span)]
            } else {
                [middle(x, y), middle(x + span, y), middle(x, y + span)]
            });
        }
        let bottom = y + height - 1;
        let apex = middle(x, y) + u32::from(shape.foot.min(8)) * span;
        let along = [middle(x, bottom), middle(x + span, bottom), apex];
        let mut corners = [0; 3];
        for (i, corner) in (0..).zip(along) {
            corners[(usize::from(shape.longest.min(2)) + i) % 3] = corner;
        }
        Some(corners)
    }
}

/// 1/depth of the corners, 65535 the largest.
fn weights(shape: Shape) -> [u32; 2] {
    let [a, b, c] = shape.depths.map(|depth| {
        let depth = u32::from(depth.min(64));
        WEIGHTS[(depth & 15) as usize] >> (depth >> 4)
    });
    [a | b << 16, c]
}
