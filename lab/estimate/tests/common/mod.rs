//! What the tests share.

/// Nearly normal noise of variance 1: sums of twelve numbers of a linear congruence (Numerical Recipes, section 7.1).
pub fn noise(seed: u32) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        let mut sum = -6.0;
        for _ in 0..12 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            sum += f64::from(state) / f64::from(u32::MAX);
        }
        sum
    }
}
