/* Element tangents with the unknowns inside a cell eliminated, added to a sparse matrix; called by
 * condensation.py, which says what it is about. Here are the loops over cells alone.
 *
 * An element has 17 unknowns: 12 displacements of vertices and mid-sides, 2 of the bubble, and the
 * pressure at the 3 vertices. The pressures are taken as p0 everywhere (its "constant") and the
 * differences p1 - p0 and p2 - p0. Inside the cell are, in this order, the bubble, the two
 * differences and the constant. Outside are the displacements and, in a cell that keeps it, the
 * constant: a pressure that no bubble and no compressibility determines.
 *
 * The moduli at the quadrature points come from the laws, in UFL (forms/mixed.py): the upper
 * triangle of the derivative of (P11, P12, P21, P22, volumetric residual) by (F11, F12, F21, F22,
 * pressure unknown), and the bedding's stiffness.
 */

#include <math.h>
#include <stdint.h>
#include <string.h>

enum { ELEMENT = 17, DISPLACEMENTS = 12, BUBBLE = 12, PRESSURE = 14, CONSTANT = 4 };
enum { INSIDE = 5, OUTSIDE = 13 };
/* Rows filled up with zeros to whole vectors: of 13, and of 13 and 5. */
enum { PADDED = 16, COLUMNS = 24 };

enum { NODES = 6, POINTS = 6, MODULI = 16, BEDDING = 15, SHAPES = 7, LANES = 8 };

typedef void moduli_kernel(double *D, const double *w, const double *c, const double *coordinates,
                           const int *facet, const uint8_t *permutation);

/* Reference element at the quadrature points. */
typedef struct {
    double weight[POINTS];
    double node[POINTS][NODES][2];       /* derivatives of the geometry's shape functions */
    double shape[POINTS][LANES];         /* those of a displacement component, the bubble last */
    double gradient[POINTS][2][LANES];   /* and their derivatives */
    double pressure[POINTS][3];          /* 1, and the shape functions of vertices 1 and 2 */
} reference_element;

/* Every x86-64 runs the plain copy; those that have AVX2 run the other one. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define VECTORISED __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define VECTORISED
#endif

/* Derivatives of the shape functions by x and y at a point; returns det(dx/dX). */
static inline double gradients(const reference_element *at, int q, double x[NODES][3],
                               double gx[LANES], double gy[LANES])
{
    double J[2][2] = {{0.0}};
    for (int n = 0; n < NODES; ++n)
        for (int i = 0; i < 2; ++i)
            for (int j = 0; j < 2; ++j)
                J[i][j] += x[n][i] * at->node[q][n][j];
    double det = J[0][0] * J[1][1] - J[0][1] * J[1][0], inverse = 1.0 / det;
    for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j)
            J[i][j] *= inverse;
    for (int b = 0; b < LANES; ++b) {
        gx[b] = J[1][1] * at->gradient[q][0][b] - J[1][0] * at->gradient[q][1][b];
        gy[b] = J[0][0] * at->gradient[q][1][b] - J[0][1] * at->gradient[q][0][b];
    }
    return det;
}

/* Tangent of one element: the moduli between the gradients of its shape functions. */
VECTORISED static void element_tangent(const reference_element *at, double x[NODES][3],
                                       double moduli[POINTS][MODULI], double A[ELEMENT][ELEMENT])
{
    double gx[POINTS][LANES], gy[POINTS][LANES], left[POINTS][6][LANES];
    double xx[SHAPES][LANES], xy[SHAPES][LANES], yy[SHAPES][LANES];
    double xp[3][LANES] = {{0.0}}, yp[3][LANES] = {{0.0}}, pp[3][3] = {{0.0}};
    for (int q = 0; q < POINTS; ++q) {
        double weight = at->weight[q] * fabs(gradients(at, q, x, gx[q], gy[q]));
        double *D = moduli[q];
        for (int k = 0; k < MODULI; ++k)
            D[k] *= weight;
        for (int a = 0; a < LANES; ++a) {
            left[q][0][a] = gx[q][a] * D[0] + gy[q][a] * D[1];
            left[q][1][a] = gx[q][a] * D[1] + gy[q][a] * D[5];
            left[q][2][a] = gx[q][a] * D[2] + gy[q][a] * D[6];
            left[q][3][a] = gx[q][a] * D[3] + gy[q][a] * D[7];
            left[q][4][a] = gx[q][a] * D[9] + gy[q][a] * D[10];
            left[q][5][a] = gx[q][a] * D[10] + gy[q][a] * D[12];
        }
        for (int m = 0; m < 3; ++m) {
            double phi = at->pressure[q][m];
            for (int b = 0; b < LANES; ++b) {
                xp[m][b] += phi * (gx[q][b] * D[4] + gy[q][b] * D[8]);
                yp[m][b] += phi * (gx[q][b] * D[11] + gy[q][b] * D[13]);
            }
            for (int n = 0; n < 3; ++n)
                pp[m][n] += phi * at->pressure[q][n] * D[14];
        }
    }
    for (int a = 0; a < SHAPES; ++a) {
        double row_xx[LANES] = {0.0}, row_xy[LANES] = {0.0}, row_yy[LANES] = {0.0};
        for (int q = 0; q < POINTS; ++q)
            for (int b = 0; b < LANES; ++b) {
                row_xx[b] += left[q][0][a] * gx[q][b] + left[q][1][a] * gy[q][b];
                row_xy[b] += left[q][2][a] * gx[q][b] + left[q][3][a] * gy[q][b];
                row_yy[b] += left[q][4][a] * gx[q][b] + left[q][5][a] * gy[q][b];
            }
        for (int q = 0; q < POINTS; ++q)
            if (moduli[q][BEDDING] != 0.0)
                for (int b = 0; b < LANES; ++b) {
                    double mass = moduli[q][BEDDING] * at->shape[q][a] * at->shape[q][b];
                    row_xx[b] += mass;
                    row_yy[b] += mass;
                }
        memcpy(xx[a], row_xx, sizeof row_xx);
        memcpy(xy[a], row_xy, sizeof row_xy);
        memcpy(yy[a], row_yy, sizeof row_yy);
    }
    for (int a = 0; a < SHAPES; ++a)
        for (int b = 0; b < SHAPES; ++b) {
            A[2 * a][2 * b] = xx[a][b];
            A[2 * a][2 * b + 1] = xy[a][b];
            A[2 * b + 1][2 * a] = xy[a][b];
            A[2 * a + 1][2 * b + 1] = yy[a][b];
        }
    for (int m = 0; m < 3; ++m) {
        for (int b = 0; b < SHAPES; ++b) {
            A[PRESSURE + m][2 * b] = A[2 * b][PRESSURE + m] = xp[m][b];
            A[PRESSURE + m][2 * b + 1] = A[2 * b + 1][PRESSURE + m] = yp[m][b];
        }
        for (int n = 0; n < 3; ++n)
            A[PRESSURE + m][PRESSURE + n] = pp[m][n];
    }
}

/* Solve B X = C in place by elimination with pivots. */
static inline void solve_inside(double B[INSIDE][8], double C[INSIDE][COLUMNS])
{
    for (int k = 0; k < INSIDE; ++k) {
        int pivot = k;
        for (int i = k + 1; i < INSIDE; ++i)
            if (fabs(B[i][k]) > fabs(B[pivot][k]))
                pivot = i;
        if (pivot != k) {
            double row[COLUMNS];
            memcpy(row, C[k], sizeof C[k]);
            memcpy(C[k], C[pivot], sizeof C[k]);
            memcpy(C[pivot], row, sizeof C[k]);
            memcpy(row, B[k], sizeof B[k]);
            memcpy(B[k], B[pivot], sizeof B[k]);
            memcpy(B[pivot], row, sizeof B[k]);
        }
        double scale = 1.0 / B[k][k];
        for (int j = 0; j < 8; ++j)
            B[k][j] *= scale;
        for (int j = 0; j < COLUMNS; ++j)
            C[k][j] *= scale;
        for (int i = 0; i < INSIDE; ++i) {
            if (i == k)
                continue;
            double factor = B[i][k];
            for (int j = 0; j < 8; ++j)
                B[i][j] -= factor * B[k][j];
            for (int j = 0; j < COLUMNS; ++j)
                C[i][j] -= factor * C[k][j];
        }
    }
}

VECTORISED static void eliminate(double A[ELEMENT][ELEMENT], int keeps_constant, double *inverse,
                                 double *coupling, double S[OUTSIDE][PADDED])
{
    static const int inside[INSIDE] = {BUBBLE, BUBBLE + 1, PRESSURE + 1, PRESSURE + 2, PRESSURE};
    double B[INSIDE][8] = {{0.0}}, C[INSIDE][COLUMNS] = {{0.0}}, K[INSIDE][PADDED] = {{0.0}};
    for (int i = 0; i < INSIDE; ++i) {
        memcpy(K[i], A[inside[i]], DISPLACEMENTS * sizeof(double));
        K[i][DISPLACEMENTS] = A[inside[i]][PRESSURE];
        for (int j = 0; j < INSIDE; ++j)
            B[i][j] = A[inside[i]][inside[j]];
        C[i][PADDED + i] = 1.0;
    }
    if (keeps_constant) { /* outside: nothing is left of it inside */
        for (int j = 0; j < INSIDE; ++j)
            B[CONSTANT][j] = B[j][CONSTANT] = j == CONSTANT;
        memset(K[CONSTANT], 0, sizeof K[CONSTANT]);
        C[CONSTANT][PADDED + CONSTANT] = 0.0;
    } else { /* inside: nothing is left of it outside */
        for (int i = 0; i < INSIDE; ++i)
            K[i][DISPLACEMENTS] = 0.0;
    }
    for (int i = 0; i < INSIDE; ++i)
        memcpy(C[i], K[i], sizeof K[i]);
    solve_inside(B, C);
    for (int i = 0; i < INSIDE; ++i) {
        memcpy(coupling + i * OUTSIDE, C[i], OUTSIDE * sizeof(double));
        memcpy(inverse + i * INSIDE, C[i] + PADDED, INSIDE * sizeof(double));
    }
    for (int i = 0; i < OUTSIDE; ++i) {
        double row[PADDED] = {0.0};
        memcpy(row, A[i < DISPLACEMENTS ? i : PRESSURE], DISPLACEMENTS * sizeof(double));
        row[DISPLACEMENTS] = A[i < DISPLACEMENTS ? i : PRESSURE][PRESSURE];
        for (int k = 0; k < INSIDE; ++k) /* the tissues' tangent is symmetric */
            for (int j = 0; j < PADDED; ++j)
                row[j] -= K[k][i] * C[k][j];
        memcpy(S[i], row, sizeof row);
    }
}

/* Tangents of n cells, with the moduli of their law, added to the matrix's values. */
void add_cells(intptr_t law, const double *element, int n, const int32_t *cells,
               const double *coefficients, int n_coefficients, const double *x,
               const int32_t *nodes, const uint8_t *keeps_constant, const int32_t *positions,
               double *inverse, double *coupling, double *values)
{
    moduli_kernel *tabulate = (moduli_kernel *)law;
    const reference_element *at = (const reference_element *)element;
    for (int i = 0; i < n; ++i) {
        int cell = cells[i];
        const int32_t *position = positions + (size_t)cell * OUTSIDE * OUTSIDE;
        double coordinates[NODES][3], moduli[POINTS][MODULI] = {{0.0}};
        double A[ELEMENT][ELEMENT], S[OUTSIDE][PADDED];
        for (int j = 0; j < NODES; ++j)
            memcpy(coordinates[j], x + 3 * (size_t)nodes[(size_t)cell * NODES + j],
                   sizeof coordinates[j]);
        tabulate(&moduli[0][0], coefficients + (size_t)i * n_coefficients, 0, &coordinates[0][0],
                 0, 0);
        element_tangent(at, coordinates, moduli, A);
        eliminate(A, keeps_constant[cell], inverse + (size_t)cell * INSIDE * INSIDE,
                  coupling + (size_t)cell * INSIDE * OUTSIDE, S);
        int n_outside = keeps_constant[cell] ? OUTSIDE : DISPLACEMENTS;
        for (int j = 0; j < n_outside; ++j)
            for (int k = 0; k < n_outside; ++k)
                if (position[j * OUTSIDE + k] >= 0)
                    values[position[j * OUTSIDE + k]] += S[j][k];
    }
}

/* Right hand side: take what the residual inside of n cells does outside from `outside`. */
void forward(int n, const double *residual, const int32_t *dofs, const int32_t *numbers,
             const double *coupling, double *outside)
{
    for (int cell = 0; cell < n; ++cell) {
        const int32_t *dof = dofs + (size_t)cell * INSIDE;
        const int32_t *number = numbers + (size_t)cell * OUTSIDE;
        const double *G = coupling + (size_t)cell * INSIDE * OUTSIDE;
        double r[INSIDE], s[OUTSIDE] = {0.0};
        for (int i = 0; i < INSIDE; ++i)
            r[i] = residual[dof[i]];
        r[CONSTANT] += r[2] + r[3];
        for (int i = 0; i < INSIDE; ++i)
            for (int j = 0; j < OUTSIDE; ++j)
                s[j] += r[i] * G[i * OUTSIDE + j];
        for (int j = 0; j < OUTSIDE; ++j)
            if (number[j] >= 0)
                outside[number[j]] -= s[j];
        if (number[OUTSIDE - 1] >= 0) /* the constant is outside: p0's residual is there already */
            outside[number[OUTSIDE - 1]] += r[2] + r[3];
    }
}

/* What is inside of n cells, from the residual there and what is outside. */
void backward(int n, const double *residual, const int32_t *dofs, const int32_t *numbers,
              const double *inverse, const double *coupling, const double *outside, double *solution)
{
    for (int cell = 0; cell < n; ++cell) {
        const int32_t *dof = dofs + (size_t)cell * INSIDE;
        const int32_t *number = numbers + (size_t)cell * OUTSIDE;
        const double *G = coupling + (size_t)cell * INSIDE * OUTSIDE;
        const double *D = inverse + (size_t)cell * INSIDE * INSIDE;
        double r[INSIDE], x[INSIDE], s[OUTSIDE];
        for (int i = 0; i < INSIDE; ++i)
            r[i] = residual[dof[i]];
        r[CONSTANT] += r[2] + r[3];
        for (int j = 0; j < OUTSIDE; ++j)
            s[j] = number[j] >= 0 ? outside[number[j]] : 0.0;
        for (int i = 0; i < INSIDE; ++i) {
            x[i] = 0.0;
            for (int j = 0; j < INSIDE; ++j)
                x[i] += D[i * INSIDE + j] * r[j];
            for (int j = 0; j < OUTSIDE; ++j)
                x[i] -= G[i * OUTSIDE + j] * s[j];
        }
        if (number[OUTSIDE - 1] >= 0) /* the constant is outside */
            x[CONSTANT] = s[OUTSIDE - 1];
        solution[dof[0]] = x[0];
        solution[dof[1]] = x[1];
        solution[dof[2]] = x[2] + x[CONSTANT];
        solution[dof[3]] = x[3] + x[CONSTANT];
        solution[dof[4]] = x[CONSTANT];
    }
}

/* Place of (row, column) among a sparse matrix's values; -1 where the pattern lacks it. */
static int32_t place(int32_t row, int32_t column, const int64_t *starts, const int32_t *columns)
{
    int64_t low = starts[row], high = starts[row + 1];
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (columns[middle] < column)
            low = middle + 1;
        else
            high = middle;
    }
    return low < starts[row + 1] && columns[low] == column ? (int32_t)low : -1;
}

/* Places of n blocks (m x m) with the same rows and columns; -1 where one is negative. */
void locate(int n, int m, const int32_t *numbers, const int64_t *starts, const int32_t *columns,
            int32_t *positions)
{
    for (int i = 0; i < n; ++i, numbers += m, positions += (size_t)m * m)
        for (int j = 0; j < m; ++j)
            for (int k = 0; k < m; ++k)
                positions[j * m + k] = numbers[j] < 0 || numbers[k] < 0
                                           ? -1
                                           : place(numbers[j], numbers[k], starts, columns);
}

/* Add n blocks (m x m) to the values; return how many entries the pattern lacks. */
int add_blocks(int n, int m, const int32_t *numbers, const double *blocks, const int64_t *starts,
               const int32_t *columns, double *values)
{
    int lacking = 0;
    for (int i = 0; i < n; ++i, numbers += m, blocks += (size_t)m * m)
        for (int j = 0; j < m; ++j)
            for (int k = 0; k < m; ++k) {
                double value = blocks[j * m + k];
                if (numbers[j] < 0 || numbers[k] < 0 || value == 0.0)
                    continue;
                int32_t position = place(numbers[j], numbers[k], starts, columns);
                if (position < 0)
                    ++lacking;
                else
                    values[position] += value;
            }
    return lacking;
}
