//! The mathematical functions that the standard library calls, from the crate that plant and controller use: one copy instead of two.

// SAFETY of the names: they are those of the C library, with its signatures; the compiler's own are weak.
macro_rules! functions {
    ($($name:ident($($argument:ident),*))*) => {
        $(
            #[unsafe(no_mangle)]
            extern "C" fn $name($($argument: f64),*) -> f64 {
                libm::$name($($argument),*)
            }
        )*
    };
}

functions! {
    sin(x) cos(x) exp(x) log(x) atan(x) atan2(y, x) hypot(x, y)
}
