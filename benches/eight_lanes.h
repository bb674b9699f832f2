// Eight doubles in two AVX2 registers, under the names that the kernels written for AVX-512 use. `limits.py` includes this file where the
// processor has no AVX-512.
#include <immintrin.h>
#include <cmath>

#define INLINE inline __attribute__((always_inline))
typedef double Half __attribute__((vector_size(32)));
typedef long long HalfBits __attribute__((vector_size(32)));

struct Bits {
  HalfBits low, high;
};

struct v8 {
  Half low, high;
  v8() = default;
  INLINE v8(double x) : low(x - (Half){}), high(x - (Half){}) {}
  INLINE v8(Half a, Half b) : low(a), high(b) {}
  INLINE explicit v8(Bits x) : low((Half)x.low), high((Half)x.high) {}
  INLINE explicit operator Bits() const { return {(HalfBits)low, (HalfBits)high}; }
  INLINE double& operator[](int i) { return reinterpret_cast<double*>(this)[i]; }
  INLINE double operator[](int i) const { return reinterpret_cast<const double*>(this)[i]; }
};

#define OPERATOR(o) \
  INLINE v8 operator o(v8 a, v8 b) { return v8(a.low o b.low, a.high o b.high); } \
  INLINE v8 operator o(v8 a, double b) { return a o v8(b); } \
  INLINE v8 operator o(double a, v8 b) { return v8(a) o b; }
OPERATOR(+) OPERATOR(-) OPERATOR(*) OPERATOR(/)
#undef OPERATOR
INLINE v8 operator-(v8 a) { return v8(-a.low, -a.high); }
INLINE v8& operator-=(v8& a, v8 b) { return a = a - b; }

#define __m512d v8
#define __m512i Bits
#define __mmask8 Bits
#define INTEGERS(name, expression) \
  INLINE HalfBits half_##name(HalfBits a, HalfBits b) { return expression; } \
  INLINE Bits name(Bits a, Bits b) { return {half_##name(a.low, b.low), half_##name(a.high, b.high)}; }
INTEGERS(eight_add, a + b)
INTEGERS(eight_and, a & b)
INTEGERS(eight_xor, a ^ b)
INTEGERS(eight_test, (a & b) != 0)
INLINE Bits eight_integer(long long x) { return {x - (HalfBits){}, x - (HalfBits){}}; }
INLINE Bits eight_shift(Bits a, int by) { return {a.low << by, a.high << by}; }
// 1.5 * 2^52: adding it rounds to an integer, which is then in the low bits. The barrier keeps the compiler from cancelling the sum.
INLINE v8 eight_magic(v8 x) { x = x + 6755399441055744.0; asm("" : "+x"(x.low), "+x"(x.high)); return x; }
INLINE v8 eight_blend(Bits m, v8 no, v8 yes) {
  return v8(_mm256_blendv_pd(no.low, yes.low, (Half)m.low), _mm256_blendv_pd(no.high, yes.high, (Half)m.high));
}

#define _mm512_set1_pd(x) v8(x)
#define _mm512_set1_epi64(x) eight_integer(x)
#define _mm512_mul_pd(a, b) ((a) * (b))
#define _mm512_div_pd(a, b) ((a) / (b))
#define _mm512_fmadd_pd(a, b, c) ((a) * (b) + (c))
#define _mm512_fnmadd_pd(a, b, c) ((c) - (a) * (b))
#define _mm512_abs_pd(a) v8(eight_and((Bits)(a), eight_integer(0x7fffffffffffffff)))
#define _mm512_max_pd(a, b) v8(_mm256_max_pd((a).low, (b).low), _mm256_max_pd((a).high, (b).high))
#define _mm512_roundscale_pd(x, mode) (eight_magic(x) - 6755399441055744.0)
#define _mm512_cvtpd_epi64(x) ((Bits)eight_magic(x))
#define _mm512_castpd_si512(x) ((Bits)(x))
#define _mm512_test_epi64_mask(a, b) eight_test(a, b)
#define _mm512_mask_blend_pd(m, no, yes) eight_blend(m, no, yes)
#define _mm512_and_si512(a, b) eight_and(a, b)
#define _mm512_xor_si512(a, b) eight_xor(a, b)
#define _mm512_add_epi64(a, b) eight_add(a, b)
#define _mm512_slli_epi64(a, by) eight_shift(a, by)
// An estimate is refined by the kernels; the quotient is as good as the refined one.
#define _mm512_rcp14_pd(x) (1.0 / (x))
INLINE double eight_sum(v8 x) { return ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7])); }
#define _mm512_reduce_add_pd(x) eight_sum(x)
#undef INLINE
