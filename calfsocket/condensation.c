/* Element tangents with the unknowns inside a cell eliminated, added to a sparse matrix; called by
 * condensation.py, which says what it is about. Here are the loops over cells alone.
 *
 * An element has 17 unknowns: 12 displacements of vertices and mid-sides, 2 of the bubble, and the
 * pressure at the 3 vertices. The pressures are taken as p0 everywhere (its "constant") and the
 * differences p1 - p0 and p2 - p0. Inside the cell are, in this order, the bubble, the two
 * differences and the constant. Outside are the displacements and, in a cell that keeps it, the
 * constant: a pressure that no bubble and no compressibility determines.
 */

#include <math.h>
#include <stdint.h>
#include <string.h>

enum { ELEMENT = 17, DISPLACEMENTS = 12, BUBBLE = 12, PRESSURE = 14, CONSTANT = 4 };
enum { INSIDE = 5, OUTSIDE = 13, MOST_NODES = 6 };
/* Rows filled up with zeros to whole vectors: of 13, and of 13 and 5. */
enum { PADDED = 16, COLUMNS = 24 };

typedef void element_kernel(double *A, const double *w, const double *c, const double *coordinates,
                            const int *facet, const uint8_t *permutation);

/* Every x86-64 runs the plain copy; those that have AVX2 run the other one. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define VECTORISED __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define VECTORISED
#endif

/* Pressures at the vertices, in rows or columns `step` apart, to constant and differences. */
static void sum_up(double *entry, int count, int step, int across)
{
    for (int i = 0; i < count; ++i) {
        double *p = entry + i * across;
        p[0] += p[step] + p[2 * step];
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
        const double *row = A[i < DISPLACEMENTS ? i : PRESSURE];
        memcpy(S[i], row, DISPLACEMENTS * sizeof(double));
        S[i][DISPLACEMENTS] = row[PRESSURE];
        for (int k = 0; k < INSIDE; ++k) {
            double factor = K[k][i]; /* the tissues' tangent is symmetric */
            for (int j = 0; j < PADDED; ++j)
                S[i][j] -= factor * C[k][j];
        }
    }
}

/* Tangents of n cells, by the compiled form of their law, added to the matrix's values. */
void add_cells(intptr_t kernel, int n, const int32_t *cells, const double *coefficients,
               int n_coefficients, const double *x, const int32_t *nodes, int n_nodes,
               const uint8_t *keeps_constant, const int32_t *positions, double *inverse,
               double *coupling, double *values)
{
    element_kernel *tabulate = (element_kernel *)kernel;
    for (int i = 0; i < n; ++i) {
        int cell = cells[i];
        const int32_t *position = positions + (size_t)cell * OUTSIDE * OUTSIDE;
        double A[ELEMENT][ELEMENT] = {{0.0}}, S[OUTSIDE][PADDED] = {{0.0}};
        double coordinates[MOST_NODES][3];
        for (int j = 0; j < n_nodes; ++j)
            memcpy(coordinates[j], x + 3 * (size_t)nodes[(size_t)cell * n_nodes + j],
                   sizeof coordinates[j]);
        tabulate(&A[0][0], coefficients + (size_t)i * n_coefficients, 0, &coordinates[0][0], 0, 0);
        sum_up(&A[0][PRESSURE], ELEMENT, 1, ELEMENT);
        sum_up(&A[PRESSURE][0], ELEMENT, ELEMENT, 1);
        for (int j = 0; j < DISPLACEMENTS; ++j)
            if (position[j * OUTSIDE + j] < 0) /* held */
                for (int k = 0; k < ELEMENT; ++k)
                    A[j][k] = A[k][j] = 0.0;
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
