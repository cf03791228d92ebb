//! A set of points of a plan.

/// Points of a plan, one bit each.
#[derive(Clone, PartialEq, Debug)]
pub struct Points {
    bits: Vec<u64>,
    count: u64,
}

impl Points {
    /// Returns the empty set for a plan with this many points.
    pub fn none(of: u64) -> Self {
        Self { bits: vec![0; of.div_ceil(64) as usize], count: 0 }
    }

    /// Returns whether the set contains a point.
    pub fn has(&self, index: u64) -> bool {
        self.bits.get((index / 64) as usize).is_some_and(|word| word >> (index % 64) & 1 == 1)
    }

    /// Adds a point of the plan; returns whether it is new.
    pub fn add(&mut self, index: u64) -> bool {
        let is_new = !self.has(index);
        self.bits[(index / 64) as usize] |= 1 << (index % 64);
        self.count += u64::from(is_new);
        is_new
    }

    /// Returns the number of points in the set.
    pub fn count(&self) -> u64 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_counted_once() {
        let mut points = Points::none(130);
        assert!(points.add(0) && points.add(129) && !points.add(129));
        assert_eq!((points.count(), points.has(129), points.has(128), points.has(4000)), (2, true, false, false));
    }
}
