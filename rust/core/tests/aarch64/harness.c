/* Runs machine code of programs on the memory that belongs to it, and compares the frame with the expected bits.
   A NaN may be any NaN. Registers v8 to v15 must come back unchanged in their low halves. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

struct entry {
    void (*code)(double *, const double *, const double *, uint64_t);
    double *frame;
    const double *constants;
    const double *stream;
    uint64_t turns;
    const double *expected;
    uint64_t length;
};
extern const struct entry cases[];
extern const uint64_t count;

static int differ(double a, double b) {
    return memcmp(&a, &b, sizeof a) != 0 && !(a != a && b != b);
}

/* The compiler keeps values in v8 to v15 across the call, because the code promises to keep them. */
static int run(const struct entry *entry) {
    register double r8 __asm__("d8") = 8, r9 __asm__("d9") = 9, r10 __asm__("d10") = 10, r11 __asm__("d11") = 11;
    register double r12 __asm__("d12") = 12, r13 __asm__("d13") = 13, r14 __asm__("d14") = 14, r15 __asm__("d15") = 15;
    register double *frame __asm__("x0") = entry->frame;
    register const double *constants __asm__("x1") = entry->constants;
    register const double *stream __asm__("x2") = entry->stream;
    register uint64_t turns __asm__("x3") = entry->turns;
    register void (*code)(double *, const double *, const double *, uint64_t) __asm__("x10") = entry->code;
    __asm__ volatile("blr %[code]"
                     : "+r"(frame), "+r"(constants), "+r"(stream), "+r"(turns), [code] "+r"(code), "+w"(r8), "+w"(r9), "+w"(r10), "+w"(r11), "+w"(r12), "+w"(r13),
                       "+w"(r14), "+w"(r15)
                     :
                     : "x9", "x30", "memory", "cc", "v0", "v1", "v2", "v3", "v4", "v5", "v6", "v7", "v16", "v17", "v18", "v19", "v20",
                       "v21", "v22", "v23", "v24", "v25", "v26", "v27", "v28", "v29", "v30", "v31");
    return r8 == 8 && r9 == 9 && r10 == 10 && r11 == 11 && r12 == 12 && r13 == 13 && r14 == 14 && r15 == 15;
}

int main(void) {
    uint64_t wrong = 0;
    for (uint64_t i = 0; i < count; i++) {
        if (!run(&cases[i])) {
            printf("case %" PRIu64 ": a register of the caller changed\n", i);
            wrong++;
        }
        for (uint64_t k = 0; k < cases[i].length; k++) {
            if (differ(cases[i].frame[k], cases[i].expected[k])) {
                printf("case %" PRIu64 ": number %" PRIu64 " is %a not %a\n", i, k, cases[i].frame[k], cases[i].expected[k]);
                wrong++;
                break;
            }
        }
    }
    printf("%" PRIu64 " cases, %" PRIu64 " wrong\n", count, wrong);
    return wrong != 0 || count == 0;
}
