//! A measured number, and the bound that it must keep.

use std::fmt;

/// What a value must keep.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Bound {
    AtMost(f64),
    AtLeast(f64),
    Within(f64, f64),
}

/// What was measured, and what must hold of it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Property {
    what: String,
    pub(super) value: f64,
    bound: Bound,
}

impl Property {
    pub(super) fn at_most(what: impl Into<String>, value: f64, bound: f64) -> Self {
        Self::new(what, value, Bound::AtMost(bound))
    }

    pub(super) fn at_least(what: impl Into<String>, value: f64, bound: f64) -> Self {
        Self::new(what, value, Bound::AtLeast(bound))
    }

    pub(super) fn within(what: impl Into<String>, value: f64, low: f64, high: f64) -> Self {
        Self::new(what, value, Bound::Within(low, high))
    }

    /// `found` differs from `expected` by this share of it at most.
    pub(super) fn near(what: impl fmt::Display, found: f64, expected: f64, share: f64) -> Self {
        let error = ((found - expected) / expected).abs();
        Self::at_most(format!("{what}: relative error"), error, share)
    }

    /// A case that did not come to its end.
    pub(super) fn failed(why: &str) -> Self {
        Self::at_least(format!("comes to its end ({why})"), 0.0, 1.0)
    }

    fn new(what: impl Into<String>, value: f64, bound: Bound) -> Self {
        Self {
            what: what.into(),
            value,
            bound,
        }
    }

    /// What was measured, and on which side of the bound it must lie.
    pub(super) fn name(&self) -> String {
        let side = match self.bound {
            Bound::AtMost(_) => "at most",
            Bound::AtLeast(_) => "at least",
            Bound::Within(..) => "within",
        };
        format!("{}, {side}", self.what)
    }

    pub(super) fn bound(&self) -> String {
        match self.bound {
            Bound::AtMost(bound) | Bound::AtLeast(bound) => number(bound),
            Bound::Within(low, high) => format!("{} to {}", number(low), number(high)),
        }
    }

    /// What is no number holds nowhere.
    pub(super) fn holds(&self) -> bool {
        match self.bound {
            Bound::AtMost(bound) => self.value <= bound,
            Bound::AtLeast(bound) => self.value >= bound,
            Bound::Within(low, high) => (low..=high).contains(&self.value),
        }
    }
}

impl fmt::Display for Property {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = number(self.value);
        write!(f, "{} {}: {value}", self.name(), self.bound())
    }
}

/// The greatest of numbers from zero on; no number where one of them is none.
pub(super) fn greatest(numbers: impl IntoIterator<Item = f64>) -> f64 {
    let greater = |most: f64, next: f64| {
        if next <= most || most.is_nan() {
            most
        } else {
            next
        }
    };
    numbers.into_iter().fold(0.0, greater)
}

/// For people: four digits.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    if value == value.trunc() && size < 1e6 {
        format!("{value}")
    } else if (1e-3..1e5).contains(&size) {
        let digits = 3 - size.log10().floor() as i32;
        format!("{value:.*}", digits.max(0) as usize)
    } else {
        format!("{value:.3e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_have_a_side_and_what_is_no_number_keeps_none() {
        assert!(Property::at_most("a", 1.0, 1.0).holds());
        assert!(!Property::at_most("a", 1.1, 1.0).holds());
        assert!(!Property::at_least("a", 0.9, 1.0).holds());
        assert!(Property::within("a", 0.9, 0.8, 1.0).holds());
        assert!(!Property::within("a", 1.1, 0.8, 1.0).holds());
        assert!(Property::near("a", 2.02, 2.0, 0.0101).holds());
        assert!(!Property::failed("why").holds());
        for bad in [
            Property::at_most("a", f64::NAN, 1.0),
            Property::at_least("a", f64::NAN, 1.0),
            Property::within("a", f64::NAN, 0.0, 1.0),
            Property::near("a", f64::INFINITY, 2.0, 0.1),
        ] {
            assert!(!bad.holds(), "{bad}");
        }
        let property = Property::within("mean", 0.95, 0.9, 1.0);
        assert_eq!(property.to_string(), "mean, within 0.9000 to 1: 0.9500");
    }

    #[test]
    fn no_number_is_greater_than_all() {
        assert_eq!(greatest([1.0, 3.0, 2.0]), 3.0);
        assert_eq!(greatest([]), 0.0);
        assert!(greatest([1.0, f64::NAN, 2.0]).is_nan());
    }

    #[test]
    fn numbers_have_four_digits() {
        for (value, text) in [
            (0.0, "0"),
            (0.012_347, "0.01235"),
            (1234.56, "1235"),
            (1e-9, "1.000e-9"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
