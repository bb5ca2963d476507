//! Groups triangles into twos, into threes where one is left, and alone where
//! nothing else is possible.
//!
//! A matching in the graph of neighbours: first what makes a good rectangle,
//! best first; then triangles with a single free neighbour, who would lose it
//! otherwise (Karp and Sipser, 1981); then chains of exchanges that free a
//! partner for two lonely triangles at once (augmenting paths; we pass over
//! blossoms, which costs a solo here and there and saves most of Edmonds's
//! algorithm). Who is still alone joins a neighbouring pair.

use std::collections::VecDeque;

use super::adjacency::{Adjacency, Link};

/// Costs up to this look like a rectangle and are taken without regard to who
/// is left over: a meshed wall comes out as its quads.
const NEAR_RECTANGLE: f32 = 0.1;

/// Triangles that the search for one augmenting path visits at most. Paths in
/// meshes are a few dozen long; the bound keeps the whole search linear.
const MOST_VISITS: usize = 512;

/// No triangle.
const NONE: u32 = u32::MAX;

/// Triangles that make one patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Group {
    Solo(u32),
    Pair(u32, u32),
    /// The middle one shares an edge with each of the ends.
    Triple {
        middle: u32,
        ends: [u32; 2],
    },
}

/// Puts every triangle into one group.
pub(super) fn group(adjacency: &Adjacency) -> Vec<Group> {
    let mut matching = Matching::new(adjacency);
    matching.pair_greedily();
    matching.augment();
    matching.into_groups()
}

struct Matching<'a> {
    adjacency: &'a Adjacency,
    partner: Vec<u32>,
}

impl<'a> Matching<'a> {
    fn new(adjacency: &'a Adjacency) -> Self {
        Self {
            adjacency,
            partner: vec![NONE; adjacency.len()],
        }
    }

    fn is_free(&self, triangle: u32) -> bool {
        self.partner[triangle as usize] == NONE
    }

    fn pair(&mut self, a: u32, b: u32) {
        self.partner[a as usize] = b;
        self.partner[b as usize] = a;
    }

    fn free_neighbours(&self, triangle: u32) -> impl Iterator<Item = Link> + '_ {
        let neighbours = self.adjacency.neighbours(triangle);
        neighbours.filter(|link| self.is_free(link.triangle))
    }

    fn pair_greedily(&mut self) {
        let mut candidates: Vec<(u32, u32, u32)> = (0..self.adjacency.len() as u32)
            .flat_map(|a| {
                let neighbours = self.adjacency.neighbours(a);
                // Bits of positive floats are ordered as the floats.
                neighbours.map(move |link| (link.cost.to_bits(), a, link.triangle))
            })
            .filter(|&(_, a, b)| a < b)
            .collect();
        candidates.sort_unstable();
        let good = candidates.partition_point(|&(cost, ..)| f32::from_bits(cost) <= NEAR_RECTANGLE);
        let (good, rest) = candidates.split_at(good);
        for &(_, a, b) in good {
            if self.is_free(a) && self.is_free(b) {
                self.pair(a, b);
            }
        }
        let mut cornered: Vec<u32> = (0..self.adjacency.len() as u32).collect();
        self.pair_cornered(&mut cornered);
        for &(_, a, b) in rest {
            if self.is_free(a) && self.is_free(b) {
                self.pair(a, b);
                cornered.extend(
                    [a, b]
                        .iter()
                        .flat_map(|&t| self.free_neighbours(t))
                        .map(|l| l.triangle),
                );
                self.pair_cornered(&mut cornered);
            }
        }
    }

    /// Pairs the triangles in `suspects` that have a single free neighbour,
    /// and those that come to have only one by it.
    fn pair_cornered(&mut self, suspects: &mut Vec<u32>) {
        while let Some(triangle) = suspects.pop() {
            let mut free = self.free_neighbours(triangle);
            let (Some(only), None) = (free.next(), free.next()) else {
                continue;
            };
            drop(free);
            if self.is_free(triangle) {
                self.pair(triangle, only.triangle);
                suspects.extend(
                    self.free_neighbours(only.triangle)
                        .map(|link| link.triangle),
                );
            }
        }
    }

    /// Joins lonely triangles in twos, along paths on which pairs alternate.
    fn augment(&mut self) {
        let mut search = Search {
            reached_by: vec![NONE; self.partner.len()],
            come_from: vec![NONE; self.partner.len()],
            queue: VecDeque::new(),
        };
        for root in 0..self.partner.len() as u32 {
            if self.is_free(root) {
                self.augment_from(root, &mut search);
            }
        }
    }

    /// Breadth first, so that the shortest path exchanges the fewest pairs.
    fn augment_from(&mut self, root: u32, search: &mut Search) {
        search.queue.clear();
        search.queue.push_back(root);
        search.reached_by[root as usize] = root;
        let mut visits = 0;
        while let Some(seeker) = search.queue.pop_front() {
            for link in self.adjacency.neighbours(seeker) {
                let partner = self.partner[link.triangle as usize];
                if partner == NONE && link.triangle != root {
                    self.exchange(root, seeker, link.triangle, &search.come_from);
                    return;
                }
                let reached = |triangle: u32| search.reached_by[triangle as usize] == root;
                if partner == NONE || reached(partner) || reached(link.triangle) {
                    continue;
                }
                search.reached_by[partner as usize] = root;
                search.come_from[partner as usize] = seeker;
                search.queue.push_back(partner);
            }
            visits += 1;
            if visits == MOST_VISITS {
                return;
            }
        }
    }

    /// Gives `seeker` a free partner; who loses a partner by it gets the one
    /// that asked for it, and so on back to `root`.
    fn exchange(&mut self, root: u32, mut seeker: u32, mut free: u32, come_from: &[u32]) {
        loop {
            let left = self.partner[seeker as usize];
            self.pair(seeker, free);
            if seeker == root {
                return;
            }
            free = left;
            seeker = come_from[seeker as usize];
        }
    }

    /// Lonely triangles join the neighbouring pair that they fit best.
    fn into_groups(self) -> Vec<Group> {
        // For the middle of a triple, who joined.
        let mut joined = vec![NONE; self.partner.len()];
        let mut groups = Vec::with_capacity(self.partner.len() / 2);
        for triangle in (0..self.partner.len() as u32).filter(|&t| self.is_free(t)) {
            let best = self
                .adjacency
                .neighbours(triangle)
                .filter(|link| {
                    let partner = self.partner[link.triangle as usize];
                    partner != NONE
                        && joined[link.triangle as usize] == NONE
                        && joined[partner as usize] == NONE
                })
                .min_by(|a, b| a.cost.total_cmp(&b.cost));
            match best {
                Some(middle) => joined[middle.triangle as usize] = triangle,
                None => groups.push(Group::Solo(triangle)),
            }
        }
        for (a, &b) in (0..).zip(&self.partner) {
            if b == NONE || a > b {
                continue;
            }
            let end = |middle: u32| joined[middle as usize];
            groups.push(match (end(a), end(b)) {
                (NONE, NONE) => Group::Pair(a, b),
                (NONE, c) => Group::Triple {
                    middle: b,
                    ends: [a, c],
                },
                (c, _) => Group::Triple {
                    middle: a,
                    ends: [b, c],
                },
            });
        }
        groups
    }
}

/// Scratch of the search, kept between searches.
struct Search {
    /// The root whose search last reached a triangle that looks for a partner.
    reached_by: Vec<u32>,
    /// Who wanted the partner that such a triangle had.
    come_from: Vec<u32>,
    queue: VecDeque<u32>,
}
