//! Numbers for distinct values, in the order of their first appearance.

/// A value that can be interned: equal values have equal hashes.
pub(crate) trait Key: Copy + Eq {
    /// A hash whose high bits are well mixed.
    fn hash(&self) -> u64;
}

/// Multiplies and folds: one step of the hash of a sequence of words.
pub(super) fn mix(state: u64, word: u64) -> u64 {
    let product = u128::from(state ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c835);
    (product as u64) ^ (product >> 64) as u64
}

impl Key for u64 {
    fn hash(&self) -> u64 {
        mix(0x243f_6a88_85a3_08d3, *self)
    }
}

impl Key for [i64; 3] {
    fn hash(&self) -> u64 {
        self.iter().fold(0x1319_8a2e_0370_7344, |state, &value| mix(state, value as u64))
    }
}

impl Key for [u32; 3] {
    fn hash(&self) -> u64 {
        let [a, b, c] = self.map(u64::from);
        mix(mix(0x082e_fa98_ec4e_6c89, a << 32 | b), c)
    }
}

/// No value in a bucket.
const FREE: u32 = u32::MAX;

/// Values without repetition, each with its number; open addressing with linear probing.
#[derive(Debug)]
pub(crate) struct Interner<T> {
    values: Vec<T>,
    buckets: Vec<u32>,
}

impl<T: Key> Interner<T> {
    /// Room for about `count` values before it grows.
    pub fn with_capacity(count: usize) -> Self {
        let buckets = (count.max(8) * 2).next_power_of_two();
        Self { values: Vec::with_capacity(count), buckets: vec![FREE; buckets] }
    }

    /// The number of `value`, and whether it is new.
    pub fn intern(&mut self, value: T) -> (u32, bool) {
        if (self.values.len() + 1) * 2 > self.buckets.len() {
            self.grow();
        }
        let mask = self.buckets.len() - 1;
        let mut at = (value.hash() >> 20) as usize & mask;
        loop {
            match self.buckets[at] {
                FREE => {
                    let number = self.values.len() as u32;
                    self.buckets[at] = number;
                    self.values.push(value);
                    return (number, true);
                }
                number if self.values[number as usize] == value => return (number, false),
                _ => at = (at + 1) & mask,
            }
        }
    }

    /// The number of `value`, if it has one.
    pub fn find(&self, value: T) -> Option<u32> {
        let mask = self.buckets.len() - 1;
        let mut at = (value.hash() >> 20) as usize & mask;
        loop {
            match self.buckets[at] {
                FREE => return None,
                number if self.values[number as usize] == value => return Some(number),
                _ => at = (at + 1) & mask,
            }
        }
    }

    /// All values, by number.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// The same, without the numbers.
    pub fn into_values(self) -> Vec<T> {
        self.values
    }

    fn grow(&mut self) {
        let size = self.buckets.len() * 2;
        self.buckets.clear();
        self.buckets.resize(size, FREE);
        for (number, value) in (0u32..).zip(&self.values) {
            let mut at = (value.hash() >> 20) as usize & (size - 1);
            while self.buckets[at] != FREE {
                at = (at + 1) & (size - 1);
            }
            self.buckets[at] = number;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_follow_first_appearance() {
        let mut interner = Interner::with_capacity(0);
        let mut map = std::collections::HashMap::new();
        let mut state = 1u64;
        for _ in 0..50_000 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let value = [(state >> 33) as i64 % 30, (state >> 40) as i64 % 30 - 15, (state >> 50) as i64 % 30];
            let next = map.len() as u32;
            let expected = *map.entry(value).or_insert(next);
            assert_eq!(interner.intern(value), (expected, expected == next));
            assert_eq!(interner.values()[expected as usize], value);
        }
        assert!(interner.values().len() > 1000 && interner.values().len() == map.len());
    }
}
