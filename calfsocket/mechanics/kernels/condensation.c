/* Element tangents with the unknowns inside a cell eliminated, added to a sparse matrix; called by
 * condensation.py, which says what it is about. Here are the loops over cells alone.
 *
 * Inside the cell are, in this order, the bubble, the two pressure differences and the constant.
 * Outside are the x components of the displacements, their y components and, in a cell that keeps
 * it, the constant: a pressure that no bubble and no compressibility determines. */

#include "cells.h"

enum { INSIDE = 5, CONSTANT = 4, OUTSIDE = 13, CONSTANT_OUTSIDE = 12 };
/* In the place of an entry's position: its unknown is constrained, or the pattern lacks it. */
enum { CONSTRAINED = -1, LACKING = -2 };

/* A row of the equations inside: over the displacements outside, and over right hand sides: 1 for
 * each of the equations, and what the constant meets where it is outside. */
typedef union {
    struct {
        row displacement;
        eight other;
    };
    vector part[6];
} equation;

/* What is left outside; the tangent is symmetric, so the constant's column is its row. */
typedef struct {
    row displacement[2][NODES];
    row constant;
    double compressibility;
} condensed_matrix;

/* Solve B X = C in place by elimination with pivots. */
INLINE void solve_inside(eight B[INSIDE], equation C[INSIDE])
{
    for (int k = 0; k < INSIDE; ++k) {
        int pivot = k;
        for (int i = k + 1; i < INSIDE; ++i)
            if (fabs(B[i].at[k]) > fabs(B[pivot].at[k]))
                pivot = i;
        eight left = B[pivot];
        equation right = C[pivot];
        B[pivot] = B[k], C[pivot] = C[k];
        double scale = 1.0 / left.at[k];
        for (int h = 0; h < 2; ++h)
            left.part[h] *= scale;
        for (int h = 0; h < 6; ++h)
            right.part[h] *= scale;
        B[k] = left, C[k] = right;
        for (int i = 0; i < INSIDE; ++i) {
            if (i == k)
                continue;
            double factor = B[i].at[k];
            for (int h = 0; h < 2; ++h)
                B[i].part[h] -= factor * left.part[h];
            for (int h = 0; h < 6; ++h)
                C[i].part[h] -= factor * right.part[h];
        }
    }
}

VECTORISED static void eliminate(const element_matrix *A, int keeps_constant, double *inverse,
                                 double *coupling, condensed_matrix *S)
{
    static const int pressure[INSIDE] = {-1, -1, 1, 2, 0};
    const double(*pp)[3] = A->compressibility;
    row K[INSIDE] = {A->displacement[0][BUBBLE], A->displacement[1][BUBBLE], A->pressure[1],
                     A->pressure[2], A->pressure[0]};
    eight B[INSIDE];
    equation C[INSIDE];
    double constant[INSIDE];
    memset(B, 0, sizeof B);
    memset(C, 0, sizeof C);
    for (int i = 0; i < INSIDE; ++i) {
        for (int j = 0; j < INSIDE; ++j)
            B[i].at[j] = j < 2   ? K[i].component[j].at[BUBBLE]
                         : i < 2 ? K[j].component[i].at[BUBBLE]
                                 : pp[pressure[i]][pressure[j]];
        C[i].displacement = K[i];
        C[i].other.at[i] = 1.0;
    }
    if (keeps_constant) { /* nothing is left of it inside */
        for (int i = 0; i < INSIDE; ++i)
            C[i].other.at[INSIDE] = constant[i] = B[i].at[CONSTANT];
        for (int i = 0; i < INSIDE; ++i)
            B[CONSTANT].at[i] = B[i].at[CONSTANT] = i == CONSTANT;
        memset(&K[CONSTANT], 0, sizeof K[CONSTANT]);
        memset(&C[CONSTANT], 0, sizeof C[CONSTANT]);
    }
    solve_inside(B, C);
    for (int i = 0; i < INSIDE; ++i) {
        memcpy(inverse + i * INSIDE, C[i].other.at, INSIDE * sizeof(double));
        for (int c = 0; c < 2; ++c)
            memcpy(coupling + i * OUTSIDE + c * NODES, C[i].displacement.component[c].at,
                   NODES * sizeof(double));
        coupling[i * OUTSIDE + CONSTANT_OUTSIDE] = C[i].other.at[INSIDE];
    }
    for (int c = 0; c < 2; ++c)
        for (int a = 0; a < NODES; ++a) {
            row s = A->displacement[c][a];
            for (int k = 0; k < INSIDE; ++k) /* the tissues' tangent is symmetric */
                for (int h = 0; h < 4; ++h)
                    s.part[h] -= K[k].component[c].at[a] * C[k].part[h];
            S->displacement[c][a] = s;
        }
    if (keeps_constant) {
        row s = A->pressure[0];
        double stiffness = pp[0][0];
        for (int k = 0; k < CONSTANT; ++k) {
            for (int h = 0; h < 4; ++h)
                s.part[h] -= constant[k] * C[k].part[h];
            stiffness -= constant[k] * C[k].other.at[INSIDE];
        }
        S->constant = s;
        S->compressibility = stiffness;
    }
}

INLINE void add(double value, int32_t position, double *values)
{
    if (position >= 0)
        values[position] += value;
}

/* Tangents of n cells, added to the matrix's values. */
void add_tangents(int n, const int32_t *cells, const double *element, const double *x,
                  const int32_t *nodes, const double *unknowns, const int32_t *dofs,
                  const int64_t *parameters, const double *foundation,
                  const double *anchor, const double *stress_free, const uint8_t *keeps_constant,
                  const int32_t *positions, double *inverse, double *coupling, double *values)
{
    tissue t = {(const reference_element *)element, x, nodes, unknowns, dofs, parameters,
                foundation, anchor, stress_free};
    for (int i = 0; i < n; ++i) {
        int cell = cells[i];
        const int32_t *position = positions + (size_t)cell * OUTSIDE * OUTSIDE;
        element_matrix A;
        condensed_matrix S;
        /* The matrix's values lie apart, and come from memory while the tangent is computed. */
        for (int k = 0; k < OUTSIDE * OUTSIDE; ++k)
            if (position[k] >= 0)
                __builtin_prefetch(values + position[k], 1);
        element_tangent(&t, cell, &A);
        eliminate(&A, keeps_constant[cell], inverse + (size_t)cell * INSIDE * INSIDE,
                  coupling + (size_t)cell * INSIDE * OUTSIDE, &S);
        for (int c = 0; c < 2; ++c)
            for (int a = 0; a < NODES; ++a, position += OUTSIDE) {
                for (int d = 0; d < 2; ++d)
                    for (int b = 0; b < NODES; ++b)
                        add(S.displacement[c][a].component[d].at[b], position[d * NODES + b],
                            values);
                if (keeps_constant[cell])
                    add(S.constant.component[c].at[a], position[CONSTANT_OUTSIDE], values);
            }
        if (keeps_constant[cell]) {
            for (int d = 0; d < 2; ++d)
                for (int b = 0; b < NODES; ++b)
                    add(S.constant.component[d].at[b], position[d * NODES + b], values);
            add(S.compressibility, position[CONSTANT_OUTSIDE], values);
        }
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
              const double *inverse, const double *coupling, const double *outside,
              double *solution)
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

/* Place of (row, column) among a sparse matrix's values. */
static int32_t place(int32_t row, int32_t column, const int64_t *starts, const int32_t *columns)
{
    if (row < 0 || column < 0)
        return CONSTRAINED;
    int64_t low = starts[row], high = starts[row + 1];
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (columns[middle] < column)
            low = middle + 1;
        else
            high = middle;
    }
    return low < starts[row + 1] && columns[low] == column ? (int32_t)low : LACKING;
}

/* Places of n blocks (k x m). */
void locate(int n, int k, const int32_t *rows, int m, const int32_t *row_columns,
            const int64_t *starts, const int32_t *columns, int32_t *positions)
{
    for (int i = 0; i < n; ++i, rows += k, row_columns += m)
        for (int a = 0; a < k; ++a)
            for (int b = 0; b < m; ++b)
                *positions++ = place(rows[a], row_columns[b], starts, columns);
}

/* Add n numbers to the values at their places; return how many not zero the pattern lacks. */
int add_at(int n, const int32_t *positions, const double *numbers, double *values)
{
    int lacking = 0;
    for (int i = 0; i < n; ++i)
        if (positions[i] >= 0)
            values[positions[i]] += numbers[i];
        else
            lacking += positions[i] == LACKING && numbers[i] != 0.0;
    return lacking;
}
