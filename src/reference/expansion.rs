//! Exact sums and products of f64 as unevaluated sums of f64.
//!
//! Shewchuk, *Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates*, 1997. Exact unless an
//! intermediate leaves the range of f64, which products of a few coordinates within 2^±150 do not.

/// (s, e): s = fl(a + b) and s + e = a + b (Knuth).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// (p, e): p = fl(a b) and p + e = a b.
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    (product, a.mul_add(b, -product))
}

/// A number as a sum of f64 that do not overlap, increasing in magnitude, none of them zero.
#[derive(Clone, Debug, Default)]
pub(super) struct Expansion(Vec<f64>);

impl Expansion {
    /// The sum of `terms`.
    pub(super) fn sum(terms: impl IntoIterator<Item = f64>) -> Self {
        let mut sum = Self::default();
        terms.into_iter().for_each(|term| sum.add(term));
        sum
    }

    /// Adds one number (Grow-Expansion).
    fn add(&mut self, term: f64) {
        let mut carry = term;
        self.0.retain_mut(|component| {
            let (sum, error) = two_sum(carry, *component);
            carry = sum;
            *component = error;
            error != 0.0
        });
        if carry != 0.0 {
            self.0.push(carry);
        }
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        other.0.iter().for_each(|&term| sum.add(term));
        sum
    }

    pub(super) fn minus(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        other.0.iter().for_each(|&term| sum.add(-term));
        sum
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        let mut product = Self::default();
        for &a in &self.0 {
            for &b in &other.0 {
                let (high, low) = two_product(a, b);
                product.add(low);
                product.add(high);
            }
        }
        product.compressed()
    }

    /// The same number in the fewest components (Compress).
    fn compressed(self) -> Self {
        let mut rest = self.0.iter().rev();
        let Some(&last) = rest.next() else { return self };
        let mut upper = last;
        let mut down = Vec::with_capacity(self.0.len());
        for &component in rest {
            let (sum, error) = two_sum(upper, component);
            if error != 0.0 {
                down.push(sum);
                upper = error;
            } else {
                upper = sum;
            }
        }
        // `down` decreases in magnitude; `upper` is what is below it.
        let mut up = Vec::with_capacity(down.len() + 1);
        for &component in down.iter().rev() {
            let (sum, error) = two_sum(component, upper);
            if error != 0.0 {
                up.push(error);
            }
            upper = sum;
        }
        if upper != 0.0 {
            up.push(upper);
        }
        Self(up)
    }

    /// −1, 0 or 1.
    pub(super) fn sign(&self) -> i32 {
        match self.0.last() {
            Some(&largest) if largest < 0.0 => -1,
            Some(_) => 1,
            None => 0,
        }
    }

    /// The value within one ulp.
    pub(super) fn value(&self) -> f64 {
        self.0.iter().sum()
    }
}

/// a × b.
pub(super) fn cross(a: &[Expansion; 3], b: &[Expansion; 3]) -> [Expansion; 3] {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i].times(&b[j]).minus(&a[j].times(&b[i]))
    })
}

/// a · b.
pub(super) fn dot(a: &[Expansion; 3], b: &[Expansion; 3]) -> Expansion {
    a[0].times(&b[0]).plus(&a[1].times(&b[1])).plus(&a[2].times(&b[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Exact where all is an integer.
    fn of(x: i64) -> Expansion {
        let high = x as f64;
        Expansion::sum([high, (i128::from(x) - high as i128) as f64])
    }

    fn equals(e: &Expansion, x: i128) -> bool {
        // The components are integers, so that their sum in i128 is exact.
        e.0.iter().map(|&c| c as i128).sum::<i128>() == x && e.sign() == x.signum() as i32
    }

    proptest! {
        #[test]
        fn integers(a in any::<i64>(), b in any::<i64>(), c in -1000i64..1000) {
            prop_assert!(equals(&of(a).plus(&of(b)), i128::from(a) + i128::from(b)));
            prop_assert!(equals(&of(a).minus(&of(b)), i128::from(a) - i128::from(b)));
            let (a, b) = (a >> 1, b >> 1);
            prop_assert!(equals(&of(a).times(&of(b)), i128::from(a) * i128::from(b)));
            let difference = of(a).times(&of(b)).minus(&of(a).times(&of(b)).plus(&of(c)));
            prop_assert!(equals(&difference, -i128::from(c)));
            // Control: plain f64 loses it.
            if (a as f64 * b as f64).abs() > 1e30 {
                prop_assert!((a as f64 * b as f64) - (a as f64 * b as f64 + c as f64) == 0.0);
            }
        }
    }

    #[test]
    fn vectors() {
        let v = |x: [i64; 3]| x.map(of);
        let (a, b) = ([1 << 40, 3, -(1 << 41) - 1], [(1 << 39) + 1, 5, 7]);
        let n = cross(&v(a), &v(b));
        assert!(equals(&n[0], 3 * 7 + ((1i128 << 41) + 1) * 5));
        assert_eq!(dot(&n, &v(a)).sign(), 0);
        assert_eq!(dot(&n, &v(b)).sign(), 0);
        assert_eq!(dot(&n, &v([1, 0, 0])).sign(), 1);
    }
}
