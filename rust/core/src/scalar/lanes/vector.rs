//! The common part of the explicit vector types. The macro `vector!` defines a type and its arithmetic from names of intrinsics. So the
//! file of an instruction set contains only its special operations.

/// Defines a vector of `$lanes` doubles, stored in `$register`.
///
/// The calling file defines the remaining operations as functions. Numbers: `fma` (`a b + c`), `fnma` (`c - a b`), `recip`, `sin_cos`.
/// Masks: `lt`, `select`, and `bits`, which is the mask as an integer with one bit per lane. The last function is `enter`.
macro_rules! vector {
    ($name:ident, $register:ident, $lanes:literal, $mask:ty, $set1:ident, $add:ident, $sub:ident, $mul:ident, $div:ident,
     $sqrt:ident, $max:ident, $min:ident, $xor:ident, $andnot:ident) => {
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub struct $name($register);

        vector!(@operator $name, Add, add, AddAssign, add_assign, $add);
        vector!(@operator $name, Sub, sub, SubAssign, sub_assign, $sub);
        vector!(@operator $name, Mul, mul, MulAssign, mul_assign, $mul);

        impl Div for $name {
            type Output = Self;
            #[inline(always)]
            fn div(self, other: Self) -> Self {
                $name(unsafe { $div(self.0, other.0) })
            }
        }

        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                $name(unsafe { $xor(self.0, $set1(-0.0)) })
            }
        }

        impl Default for $name {
            #[inline(always)]
            fn default() -> Self {
                Self::splat(0.0)
            }
        }

        impl PartialEq for $name {
            fn eq(&self, other: &Self) -> bool {
                to_array(self.0) == to_array(other.0)
            }
        }

        #[inline(always)]
        fn to_array(x: $register) -> [f64; $lanes] {
            // SAFETY: both types consist of `$lanes` doubles and nothing else.
            unsafe { std::mem::transmute(x) }
        }

        #[inline(always)]
        fn from_array(x: [f64; $lanes]) -> $register {
            // SAFETY: both types consist of `$lanes` doubles and nothing else.
            unsafe { std::mem::transmute(x) }
        }

        /// Compute the lanes whose angle is beyond the range of the reduction, one by one.
        #[cold]
        #[inline(never)]
        fn far_lanes(x: $name, s: $name, c: $name) -> ($name, $name) {
            let (x, mut s, mut c) = (to_array(x.0), to_array(s.0), to_array(c.0));
            for i in 0..$lanes {
                if !(x[i].abs() < trig::REDUCTION_LIMIT) {
                    (s[i], c[i]) = trig::sin_cos_far(x[i]);
                }
            }
            ($name(from_array(s)), $name(from_array(c)))
        }

        impl Real for $name {
            type Mask = $mask;
            const LANES: usize = $lanes;


            #[inline(always)]
            fn splat(x: f64) -> Self {
                $name(from_array([x; $lanes]))
            }
            #[inline(always)]
            fn from_lanes(f: impl FnMut(usize) -> f64) -> Self {
                $name(from_array(std::array::from_fn(f)))
            }
            #[inline(always)]
            fn lane(self, i: usize) -> f64 {
                to_array(self.0)[i]
            }
            #[inline(always)]
            fn load(from: &[f64]) -> Self {
                let from = &from[..$lanes];
                let mut all = [0.0; $lanes];
                for lane in 0..$lanes {
                    all[lane] = from[lane];
                }
                $name(from_array(all))
            }
            #[inline(always)]
            fn store(self, to: &mut [f64]) {
                let (to, all) = (&mut to[..$lanes], to_array(self.0));
                for lane in 0..$lanes {
                    to[lane] = all[lane];
                }
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                $name(fma(self.0, b.0, c.0))
            }
            #[inline(always)]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                $name(fnma(self.0, b.0, c.0))
            }
            #[inline(always)]
            fn recip(self) -> Self {
                $name(recip(self.0))
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $name(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $name(unsafe { $andnot($set1(-0.0), self.0) })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // If one operand is NaN, the instruction returns its second operand, here `self`.
                $name(unsafe { $max(other.0, self.0) })
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                $name(unsafe { $min(other.0, self.0) })
            }
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                let (s, c) = self.sin_cos_near();
                let near = Self::all(self.abs().lt(Self::splat(trig::REDUCTION_LIMIT)));
                if near { (s, c) } else { far_lanes(self, s, c) }
            }
            #[inline(always)]
            fn sin_cos_near(self) -> (Self, Self) {
                let (s, c) = sin_cos(self.0);
                ($name(s), $name(c))
            }
            #[inline(always)]
            fn lt(self, other: Self) -> $mask {
                lt(self.0, other.0)
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                $name(select(mask, yes.0, no.0))
            }
            #[inline(always)]
            fn any(mask: $mask) -> bool {
                bits(mask) != 0
            }
            #[inline(always)]
            fn all(mask: $mask) -> bool {
                bits(mask) == (1 << $lanes) - 1
            }
            #[inline(always)]
            fn enter<K: Kernel>(kernel: K) -> K::Output {
                enter(kernel)
            }
        }
    };
    (@operator $name:ident, $trait:ident, $method:ident, $assign:ident, $assign_method:ident, $intrinsic:ident) => {
        impl $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                $name(unsafe { $intrinsic(self.0, other.0) })
            }
        }
        impl $assign for $name {
            #[inline(always)]
            fn $assign_method(&mut self, other: Self) {
                *self = $trait::$method(*self, other);
            }
        }
    };
}
pub(super) use vector;

/// Defines sine and cosine within the range of the reduction, without a branch. The macro uses register operations of the calling file. The
/// method is described in [`super::super::trig`].
macro_rules! sin_cos_near {
    ($register:ident, $set1:ident, $sub:ident, $mul:ident, $xor:ident, $swap:ident, $sign_of_bit_1:ident, $next:ident) => {
        #[inline(always)]
        fn sin_cos(x: $register) -> ($register, $register) {
            unsafe {
                let set = |v: f64| $set1(v);
                let rounded = fma(x, set(trig::TWO_OVER_PI), set(trig::ROUND));
                let k = $sub(rounded, set(trig::ROUND));
                let r = fnma(k, set(trig::PIO2[0]), x);
                let r = fnma(k, set(trig::PIO2[1]), r);
                let r = fnma(k, set(trig::PIO2[2]), r);
                let z = $mul(r, r);
                let (s, c) = (trig::SIN, trig::COS);
                let zz = $mul(z, z);
                let pair = |a: [f64; 6], k: usize| fma(set(a[k]), z, set(a[k + 1]));
                let sin = fma(fma(pair(s, 0), zz, pair(s, 2)), zz, pair(s, 4));
                let cos = fma(fma(pair(c, 0), zz, pair(c, 2)), zz, pair(c, 4));
                let sin = fma($mul(r, z), sin, r);
                let cos = fma(zz, cos, fnma(set(0.5), z, set(1.0)));
                let swap = $swap(rounded);
                ($xor(select(swap, cos, sin), $sign_of_bit_1(rounded)), $xor(select(swap, sin, cos), $sign_of_bit_1($next(rounded))))
            }
        }
    };
}
pub(super) use sin_cos_near;
