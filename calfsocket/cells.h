/* One element at its quadrature points: its residual and its tangent, from what its law gives there.
 *
 * An element has 17 unknowns: displacements of its 3 vertices, 3 mid-sides and bubble, and the
 * pressure at the 3 vertices. The pressures are taken as p0 everywhere (its "constant") and the
 * differences p1 - p0 and p2 - p0. A row over the displacements has a lane each for the shape
 * functions of the x components, the bubble's last, and then for those of the y components.
 *
 * The laws are in UFL (forms/mixed.py), compiled by FFCx. Their "stresses" at a point are P11, P12,
 * P21, P22, the volumetric residual and the bedding's force; their "moduli" the upper triangle of
 * the derivative of the first five by F11, F12, F21, F22 and the pressure unknown, and the bedding's
 * stiffness.
 */

#ifndef CALFSOCKET_CELLS_H
#define CALFSOCKET_CELLS_H

#include <math.h>
#include <stdint.h>
#include <string.h>

enum { NODES = 6, POINTS = 6, SHAPES = 7, LANES = 8, UNKNOWNS = 17 };
/* Place of the bubble among the shape functions. */
enum { BUBBLE = 6 };
/* Of a law: two sets of unknowns, and its parameters. */
enum { MOST_COEFFICIENTS = 64 };
enum { STRESSES = 7, VOLUME = 4, FORCE = 5 };
enum { MODULI = 16, BEDDING = 15 };

/* FFCx's kernel of an expression at the quadrature points. */
typedef void law_kernel(double *values, const double *w, const double *c,
                        const double *coordinates, const int *facet, const uint8_t *permutation);

/* GCC's and Clang's vectors, and the least alignment that arrays have. */
typedef double vector __attribute__((vector_size(4 * sizeof(double)), aligned(sizeof(double))));

/* A number for each shape function of a displacement component. */
typedef union {
    vector part[2];
    double at[LANES];
} lanes;

/* A number for each displacement: x components and then y components. */
typedef union {
    lanes component[2];
    vector part[4];
} row;

/* Reference element at the quadrature points. */
typedef struct {
    double weight[POINTS];
    double node[POINTS][NODES][2]; /* derivatives of the geometry's shape functions */
    lanes shape[POINTS];           /* those of a displacement component, the bubble last */
    lanes gradient[POINTS][2];     /* and their derivatives */
    double pressure[POINTS][3];    /* 1, and the shape functions of vertices 1 and 2 */
} reference_element;

typedef struct {
    row displacement;
    double pressure[3];
} element_vector;

typedef struct {
    row displacement[2][LANES]; /* by component and shape function */
    row pressure[3];
    double compressibility[3][3];
} element_matrix;

/* Every x86-64 runs the plain copy; those that have AVX2 run the other one. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define VECTORISED __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define VECTORISED
#endif

/* What the law gives at the points of a cell, and the coordinates of its nodes. Coefficients are
 * functions: addresses of their values and of their unknowns in each cell, and how many these are. */
static inline void at_points(intptr_t law, int n_functions, const int64_t *functions,
                             const double *x, const int32_t *nodes, int cell,
                             double coordinates[NODES][3], double *values)
{
    double w[MOST_COEFFICIENTS], *next = w;
    for (int f = 0; f < n_functions; ++f, functions += 3) {
        const double *array = (const double *)(intptr_t)functions[0];
        int n = (int)functions[2];
        const int32_t *dofs = (const int32_t *)(intptr_t)functions[1] + (size_t)cell * n;
        for (int j = 0; j < n; ++j)
            *next++ = array[dofs[j]];
    }
    for (int j = 0; j < NODES; ++j)
        memcpy(coordinates[j], x + 3 * (size_t)nodes[(size_t)cell * NODES + j],
               sizeof coordinates[j]);
    ((law_kernel *)law)(values, w, 0, &coordinates[0][0], 0, 0);
}

/* Derivatives of the shape functions by x and y at a point; returns weight times |det(dx/dX)|. */
static inline double gradients(const reference_element *at, int q, double x[NODES][3], lanes *gx,
                               lanes *gy)
{
    double J[2][2] = {{0.0}};
    for (int n = 0; n < NODES; ++n)
        for (int i = 0; i < 2; ++i)
            for (int j = 0; j < 2; ++j)
                J[i][j] += x[n][i] * at->node[q][n][j];
    double det = J[0][0] * J[1][1] - J[0][1] * J[1][0], inverse = 1.0 / det;
    for (int h = 0; h < 2; ++h) {
        vector g0 = at->gradient[q][0].part[h], g1 = at->gradient[q][1].part[h];
        gx->part[h] = (inverse * J[1][1]) * g0 - (inverse * J[1][0]) * g1;
        gy->part[h] = (inverse * J[0][0]) * g1 - (inverse * J[0][1]) * g0;
    }
    return at->weight[q] * fabs(det);
}

/* Residual of one element: the stresses on the gradients of its shape functions. */
VECTORISED static void element_residual(const reference_element *at, double x[NODES][3],
                                        double stresses[POINTS][STRESSES], element_vector *r)
{
    memset(r, 0, sizeof *r);
    for (int q = 0; q < POINTS; ++q) {
        lanes gx, gy;
        double weight = gradients(at, q, x, &gx, &gy);
        double *P = stresses[q];
        for (int k = 0; k < STRESSES; ++k)
            P[k] *= weight;
        for (int c = 0; c < 2; ++c)
            for (int h = 0; h < 2; ++h)
                r->displacement.component[c].part[h] += P[2 * c] * gx.part[h] +
                                                        P[2 * c + 1] * gy.part[h] +
                                                        P[FORCE + c] * at->shape[q].part[h];
        for (int m = 0; m < 3; ++m)
            r->pressure[m] += at->pressure[q][m] * P[VOLUME];
    }
}

/* Tangent of one element: the moduli between the gradients of its shape functions. */
VECTORISED static void element_tangent(const reference_element *at, double x[NODES][3],
                                       double moduli[POINTS][MODULI], element_matrix *A)
{
    lanes gx[POINTS], gy[POINTS], left[POINTS][6];
    memset(A->pressure, 0, sizeof A->pressure);
    memset(A->compressibility, 0, sizeof A->compressibility);
    for (int q = 0; q < POINTS; ++q) {
        double weight = gradients(at, q, x, &gx[q], &gy[q]);
        double *D = moduli[q];
        for (int k = 0; k < MODULI; ++k)
            D[k] *= weight;
        for (int h = 0; h < 2; ++h) {
            vector gxh = gx[q].part[h], gyh = gy[q].part[h];
            left[q][0].part[h] = D[0] * gxh + D[1] * gyh;
            left[q][1].part[h] = D[1] * gxh + D[5] * gyh;
            left[q][2].part[h] = D[2] * gxh + D[6] * gyh;
            left[q][3].part[h] = D[3] * gxh + D[7] * gyh;
            left[q][4].part[h] = D[9] * gxh + D[10] * gyh;
            left[q][5].part[h] = D[10] * gxh + D[12] * gyh;
            vector volume_x = D[4] * gxh + D[8] * gyh, volume_y = D[11] * gxh + D[13] * gyh;
            for (int m = 0; m < 3; ++m) {
                A->pressure[m].component[0].part[h] += at->pressure[q][m] * volume_x;
                A->pressure[m].component[1].part[h] += at->pressure[q][m] * volume_y;
            }
        }
        for (int m = 0; m < 3; ++m)
            for (int n = 0; n < 3; ++n)
                A->compressibility[m][n] += at->pressure[q][m] * at->pressure[q][n] * D[14];
    }
    for (int a = 0; a < SHAPES; ++a) {
        lanes xx = {{{0.0}}}, xy = {{{0.0}}}, yy = {{{0.0}}};
        for (int q = 0; q < POINTS; ++q)
            for (int h = 0; h < 2; ++h) {
                vector gxh = gx[q].part[h], gyh = gy[q].part[h];
                xx.part[h] += left[q][0].at[a] * gxh + left[q][1].at[a] * gyh;
                xy.part[h] += left[q][2].at[a] * gxh + left[q][3].at[a] * gyh;
                yy.part[h] += left[q][4].at[a] * gxh + left[q][5].at[a] * gyh;
            }
        for (int q = 0; q < POINTS; ++q)
            if (moduli[q][BEDDING] != 0.0)
                for (int h = 0; h < 2; ++h) {
                    vector mass =
                        moduli[q][BEDDING] * at->shape[q].at[a] * at->shape[q].part[h];
                    xx.part[h] += mass;
                    yy.part[h] += mass;
                }
        A->displacement[0][a].component[0] = xx;
        A->displacement[0][a].component[1] = xy;
        A->displacement[1][a].component[1] = yy;
        for (int b = 0; b < SHAPES; ++b)
            A->displacement[1][b].component[0].at[a] = xy.at[b];
    }
}

#endif
