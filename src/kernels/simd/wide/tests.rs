use crate::kernels::simd::isa::{Isa, for_each_isa};
use crate::kernels::simd::wide::*;

/// Zeros, infinities, what is no number of either sign, the ends of the denormals and of the normals, and numbers
/// between.
fn numbers() -> Vec<f32> {
    let mut all = vec![0.0, f32::from_bits(1), f32::MIN_POSITIVE, 1.0, 1.0 + f32::EPSILON, 0.1, 3e7, f32::MAX];
    all.extend([f32::from_bits(0x007f_ffff), f32::INFINITY, f32::NAN, f32::from_bits(0x7fc0_0123)]);
    all.extend((1..=20).map(|i| f32::from_bits(0x9e37_79b9_u32.wrapping_mul(i) >> 1)));
    let negative: Vec<f32> = all.iter().map(|x| -x).collect();
    all.extend(negative);
    all
}

/// All pairs, the lanes of vectors filled up with zeros.
fn pairs() -> [Vec<f32>; 2] {
    let numbers = numbers();
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for &x in &numbers {
        a.extend(vec![x; numbers.len()]);
        b.extend(&numbers);
    }
    let count = a.len().next_multiple_of(16);
    a.resize(count, 0.0);
    b.resize(count, 0.0);
    [a, b]
}

/// Which of several results that are no number an instruction gives is up to the instruction set.
fn same(a: f32, b: f32) -> bool {
    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
}

#[test]
fn lanes_are_computed_as_f32() {
    for_each_isa!(isa => compare_with_f32(isa));
}

fn compare_with_f32<I: Isa>(isa: I) {
    let [a, b] = pairs();
    let lanes = I::Wide::LANES;
    let for_each_vector = |f: &mut dyn FnMut(usize, I::Wide, I::Wide)| {
        for at in (0..a.len()).step_by(lanes) {
            f(at, isa.load(&a[at..]), isa.load(&b[at..]));
        }
    };
    // Of numbers: one rounding an operation.
    let arithmetic = |name: &str, wide: &dyn Fn(I::Wide, I::Wide) -> I::Wide, one: &dyn Fn(f32, f32) -> f32| {
        let mut differing = 0;
        for_each_vector(&mut |at, x, y| {
            let mut all = [0.0; 16];
            wide(x, y).store(&mut all);
            for i in 0..lanes {
                differing += u32::from(!same(all[i], one(a[at + i], b[at + i])));
            }
        });
        println!("{name}: {differing} of {} pairs differ", a.len());
        differing
    };
    assert_eq!(arithmetic("+", &|x, y| x + y, &|x, y| x + y), 0);
    assert_eq!(arithmetic("-", &|x, y| x - y, &|x, y| x - y), 0);
    assert_eq!(arithmetic("*", &|x, y| x * y, &|x, y| x * y), 0);
    assert_eq!(arithmetic("/", &|x, y| x / y, &|x, y| x / y), 0);
    assert_eq!(arithmetic("square root", &|x, _| x.sqrt(), &|x, _| x.sqrt()), 0);
    assert_eq!(arithmetic("product and sum", &|x, y| x * y + x, &|x, y| x * y + x), 0);
    // Control: one operation in place of two is told.
    assert!(arithmetic("fused", &|x, y| x * y + x, &|x, y| x.mul_add(y, x)) > 0);

    // Of words: every bit, of zeros and of what is no number, too.
    let bits = |name: &str, wide: &dyn Fn(I::Wide, I::Wide) -> I::Wide, one: &dyn Fn(u32, u32) -> u32| {
        let mut differing = 0;
        for_each_vector(&mut |at, x, y| {
            let mut all = [0.0; 16];
            wide(x, y).store(&mut all);
            for i in 0..lanes {
                differing += u32::from(all[i].to_bits() != one(a[at + i].to_bits(), b[at + i].to_bits()));
            }
        });
        println!("{name}: {differing} of {} pairs differ", a.len());
        differing
    };
    let of_numbers = |f: fn(f32, f32) -> f32| move |x, y| f(f32::from_bits(x), f32::from_bits(y)).to_bits();
    assert_eq!(bits("most", &Wide::most, &of_numbers(exact::most)), 0);
    assert_eq!(bits("least", &Wide::least, &of_numbers(exact::least)), 0);
    // Control: other functions take the greater and the lesser of two numbers as well.
    assert!(bits("max", &Wide::most, &of_numbers(f32::max)) > 0);
    assert!(bits("least, turned", &|x, y| y.least(x), &of_numbers(exact::least)) > 0);
    assert_eq!(bits("magnitude", &|x, _| x.abs(), &|x, _| x & 0x7fff_ffff), 0);
    assert_eq!(bits("and", &|x, y| x & y, &|x, y| x & y), 0);
    assert_eq!(bits("exclusive or", &|x, y| x ^ y, &|x, y| x ^ y), 0);
    assert_eq!(bits("sum of words", &Wide::add_bits, &u32::wrapping_add), 0);
    assert_eq!(bits("same word", &|_, _| isa.splat_bits(0x1234_5678), &|_, _| 0x1234_5678), 0);

    let comparison = |name: &str, wide: &dyn Fn(I::Wide, I::Wide) -> u32, one: &dyn Fn(f32, f32) -> bool| {
        let mut set = 0;
        for_each_vector(&mut |at, x, y| {
            let expected = (0..lanes).map(|i| u32::from(one(a[at + i], b[at + i])) << i).sum::<u32>();
            assert_eq!(wide(x, y), expected, "{name} of pairs {at} to {}", at + lanes);
            set += expected.count_ones() as usize;
        });
        assert!(set > 0 && set < a.len(), "{name}: {set} of {} pairs", a.len());
    };
    comparison("less", &Wide::less, &|x, y| x < y);
    comparison("less or equal", &Wide::less_equal, &|x, y| x <= y);
    comparison("same bits", &Wide::same_bits, &|x, y| x.to_bits() == y.to_bits());
    comparison("less bits", &Wide::less_bits, &|x, y| x.to_bits() < y.to_bits());

    for mask in (0..=u32::MAX >> (32 - lanes)).step_by(7) {
        let mut all = [0.0; 16];
        isa.splat(1.0).or_else(mask, isa.splat(2.0)).store(&mut all);
        for (i, x) in all[..lanes].iter().enumerate() {
            assert_eq!(*x, if mask >> i & 1 != 0 { 1.0 } else { 2.0 }, "lane {i} of mask {mask:#x}");
        }
    }
}
