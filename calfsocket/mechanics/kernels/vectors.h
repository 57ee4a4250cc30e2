/* Vectors of four numbers, and the functions of them that the laws need. */

#ifndef CALFSOCKET_VECTORS_H
#define CALFSOCKET_VECTORS_H

#include <math.h>
#include <stdint.h>
#include <string.h>

enum { WIDTH = 4 };

/* GCC's and Clang's vectors, with the least alignment that arrays have. */
typedef double vector __attribute__((vector_size(WIDTH * sizeof(double)), aligned(sizeof(double))));

/* Every x86-64 runs the plain copy of a function; those that have AVX2 run the other one. */
#ifdef PLAIN
#define VECTORISED
#elif defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define VECTORISED __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define VECTORISED
#endif
#define INLINE static inline __attribute__((always_inline))

#define BY_LANES(name)                          \
    INLINE vector vector_##name(vector x)       \
    {                                           \
        vector y;                               \
        for (int i = 0; i < WIDTH; ++i)         \
            y[i] = name(x[i]);                  \
        return y;                               \
    }
BY_LANES(sqrt)
BY_LANES(fabs)
BY_LANES(exp)
BY_LANES(log)

/* Small whole powers. */
INLINE vector vector_pow(vector x, int n)
{
    vector y = x;
    for (int i = 1; i < n; ++i)
        y *= x;
    return y;
}

#endif
