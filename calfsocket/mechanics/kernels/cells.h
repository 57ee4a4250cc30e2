/* One element at its quadrature points: its residual and its tangent.
 *
 * An element has 17 unknowns: displacements of its 3 vertices, 3 mid-sides and bubble, and the
 * pressure at the 3 vertices. The pressures are taken as p0 everywhere (its "constant") and the
 * differences p1 - p0 and p2 - p0.
 *
 * The law is in UFL (forms/mixed.py; laws.py). Its "stresses" at a point are P11, P12, P21, P22 and
 * the volumetric residual; its "moduli" the upper triangle of the derivative of these by F11, F12,
 * F21, F22 and the pressure unknown.
 */

#ifndef CALFSOCKET_CELLS_H
#define CALFSOCKET_CELLS_H

#include "vectors.h"

enum { NODES = 6, POINTS = 6, SHAPES = 7, UNKNOWNS = 17 };
/* Place of the bubble among the shape functions. */
enum { BUBBLE = 6 };
enum { STRESSES = 5, VOLUME = 4, MODULI = 15 };
/* Of a law's ARGUMENTS: strains, and parameters. */
enum { STRAINS = 5, PARAMETERS = ARGUMENTS - STRAINS };
/* Of a stress-free state: G^-1 row by row, and det G. */
enum { STRESS_FREE = 5 };

/* A number for each shape function of a displacement component, or for each quadrature point. The
 * last point stands in for those that are missing, without weight. */
enum { EIGHT = 8, PARTS = EIGHT / WIDTH };
typedef union {
    vector part[PARTS];
    double at[EIGHT];
} eight;

/* A number for each displacement: x components and then y components. */
typedef union {
    eight component[2];
    vector part[2 * PARTS];
} row;

/* Reference element; derivatives are by the reference coordinates. */
typedef struct {
    eight weight;              /* by points */
    eight node[NODES][2];      /* derivatives of the geometry's shape functions, by points */
    eight slope[SHAPES][2];    /* derivatives of the displacement's, the bubble's last, by points */
    eight pressure[3];         /* 1, and the shape functions of vertices 1 and 2, by points */
    eight shape[POINTS];       /* the displacement's shape functions */
    eight gradient[POINTS][2]; /* and their derivatives */
} reference_element;

/* What the loops need of all cells. */
typedef struct {
    const reference_element *element;
    const double *x;         /* coordinates of nodes, three each */
    const int32_t *nodes;    /* of each cell */
    const double *unknowns;  /* present values */
    const int32_t *dofs;     /* of each cell */
    const int64_t *parameters; /* addresses of values, and of each cell's place among them */
    const double *foundation; /* stiffness in each cell, or nothing */
    const double *anchor;     /* unknowns at which the foundation is at rest */
    const double *stress_free; /* STRESS_FREE numbers by points for each cell, or nothing */
} tissue;

/* One cell, at its points. With a stress-free state G the law and the gradients are those of a cell
 * that begins there: F G^-1, and a volume of det G. */
typedef struct {
    eight inverse[2][2]; /* of the derivative of stress-free coordinates by reference coordinates */
    eight weight;        /* stress-free volume */
    eight area;          /* volume in the undeformed section */
    vector arguments[PARTS][ARGUMENTS];
} cell_state;

typedef struct {
    row displacement;
    double pressure[3];
} element_vector;

typedef struct {
    row displacement[2][EIGHT]; /* by component and shape function */
    row pressure[3];
    double compressibility[3][3];
} element_matrix;

/* Take a cell's gradients by reference coordinates and its volume to its stress-free state. */
INLINE void begin_stress_free(const double *state, int h, cell_state *s)
{
    vector G[STRESS_FREE], *F = s->arguments[h];
    for (int k = 0; k < STRESS_FREE; ++k)
        memcpy(&G[k], state + k * EIGHT + h * WIDTH, sizeof G[k]);
    for (int i = 0; i < 2; ++i) {
        vector k0 = s->inverse[i][0].part[h], k1 = s->inverse[i][1].part[h];
        vector f0 = F[2 * i], f1 = F[2 * i + 1];
        for (int j = 0; j < 2; ++j) {
            s->inverse[i][j].part[h] = k0 * G[j] + k1 * G[2 + j];
            F[2 * i + j] = f0 * G[j] + f1 * G[2 + j];
        }
    }
    s->weight.part[h] *= G[4];
}

/* Geometry and arguments of the law at the points of a cell. */
INLINE void evaluate(const tissue *t, int cell, cell_state *s)
{
    const reference_element *at = t->element;
    const int32_t *nodes = t->nodes + (size_t)cell * NODES;
    const int32_t *dofs = t->dofs + (size_t)cell * UNKNOWNS;
    double parameters[PARAMETERS];
    for (int k = 0; k < PARAMETERS; ++k) {
        const double *values = (const double *)(intptr_t)t->parameters[2 * k];
        const int32_t *place = (const int32_t *)(intptr_t)t->parameters[2 * k + 1];
        parameters[k] = values[place[cell]];
    }
    double p[3];
    for (int m = 0; m < 3; ++m)
        p[m] = t->unknowns[dofs[2 * SHAPES + m]];
    for (int h = 0; h < PARTS; ++h) {
        vector J[2][2] = {{{0.0}}}, H[2][2] = {{{0.0}}};
        for (int n = 0; n < NODES; ++n)
            for (int i = 0; i < 2; ++i)
                for (int j = 0; j < 2; ++j)
                    J[i][j] += t->x[3 * (size_t)nodes[n] + i] * at->node[n][j].part[h];
        for (int a = 0; a < SHAPES; ++a)
            for (int i = 0; i < 2; ++i)
                for (int j = 0; j < 2; ++j)
                    H[i][j] += t->unknowns[dofs[2 * a + i]] * at->slope[a][j].part[h];
        vector det = J[0][0] * J[1][1] - J[0][1] * J[1][0], one_det = 1.0 / det;
        vector K[2][2] = {{J[1][1] * one_det, -J[0][1] * one_det},
                          {-J[1][0] * one_det, J[0][0] * one_det}};
        s->area.part[h] = s->weight.part[h] = at->weight.part[h] * vector_fabs(det);
        vector *arguments = s->arguments[h];
        for (int i = 0; i < 2; ++i)
            for (int j = 0; j < 2; ++j) {
                s->inverse[i][j].part[h] = K[i][j];
                arguments[2 * i + j] = H[i][0] * K[0][j] + H[i][1] * K[1][j] + (double)(i == j);
            }
        if (t->stress_free)
            begin_stress_free(t->stress_free + (size_t)cell * STRESS_FREE * EIGHT, h, s);
        arguments[4] = p[0] * at->pressure[0].part[h] + (p[1] - p[0]) * at->pressure[1].part[h] +
                       (p[2] - p[0]) * at->pressure[2].part[h];
        for (int k = 0; k < PARAMETERS; ++k)
            arguments[STRAINS + k] = (vector){0.0} + parameters[k];
    }
}

/* Derivatives of the shape functions by x and y at a point. */
INLINE void gradients(const reference_element *at, const cell_state *s, int q, eight *gx, eight *gy)
{
    for (int h = 0; h < PARTS; ++h) {
        vector g0 = at->gradient[q][0].part[h], g1 = at->gradient[q][1].part[h];
        gx->part[h] = s->inverse[0][0].at[q] * g0 + s->inverse[1][0].at[q] * g1;
        gy->part[h] = s->inverse[0][1].at[q] * g0 + s->inverse[1][1].at[q] * g1;
    }
}

/* Residual of one element: the stresses on the gradients of its shape functions. */
VECTORISED static void element_residual(const tissue *t, int cell, element_vector *r)
{
    const reference_element *at = t->element;
    cell_state s;
    vector P[PARTS][STRESSES];
    evaluate(t, cell, &s);
    for (int h = 0; h < PARTS; ++h) {
        stresses(s.arguments[h], P[h]);
        for (int k = 0; k < STRESSES; ++k)
            P[h][k] *= s.weight.part[h];
    }
    memset(r, 0, sizeof *r);
    for (int q = 0; q < POINTS; ++q) {
        eight gx, gy;
        const vector *Pq = P[q / WIDTH];
        int lane = q % WIDTH;
        gradients(at, &s, q, &gx, &gy);
        for (int c = 0; c < 2; ++c)
            for (int h = 0; h < PARTS; ++h)
                r->displacement.component[c].part[h] +=
                    Pq[2 * c][lane] * gx.part[h] + Pq[2 * c + 1][lane] * gy.part[h];
        for (int m = 0; m < 3; ++m)
            r->pressure[m] += at->pressure[m].at[q] * Pq[VOLUME][lane];
    }
    if (t->foundation && t->foundation[cell] != 0.0) {
        const int32_t *dofs = t->dofs + (size_t)cell * UNKNOWNS;
        for (int q = 0; q < POINTS; ++q)
            for (int c = 0; c < 2; ++c) {
                double u = 0.0;
                for (int a = 0; a < SHAPES; ++a) {
                    int32_t dof = dofs[2 * a + c];
                    u += at->shape[q].at[a] * (t->unknowns[dof] - t->anchor[dof]);
                }
                for (int h = 0; h < PARTS; ++h)
                    r->displacement.component[c].part[h] +=
                        s.area.at[q] * t->foundation[cell] * u * at->shape[q].part[h];
            }
    }
}

/* Tangent of one element: the moduli between the gradients of its shape functions. */
VECTORISED static void element_tangent(const tissue *t, int cell, element_matrix *A)
{
    const reference_element *at = t->element;
    cell_state s;
    vector moduli_at[PARTS][MODULI];
    eight gx[POINTS], gy[POINTS], left[POINTS][6];
    evaluate(t, cell, &s);
    for (int h = 0; h < PARTS; ++h) {
        moduli(s.arguments[h], moduli_at[h]);
        for (int k = 0; k < MODULI; ++k)
            moduli_at[h][k] *= s.weight.part[h];
    }
    memset(A->pressure, 0, sizeof A->pressure);
    memset(A->compressibility, 0, sizeof A->compressibility);
    for (int q = 0; q < POINTS; ++q) {
        double D[MODULI];
        for (int k = 0; k < MODULI; ++k)
            D[k] = moduli_at[q / WIDTH][k][q % WIDTH];
        gradients(at, &s, q, &gx[q], &gy[q]);
        for (int h = 0; h < PARTS; ++h) {
            vector gxh = gx[q].part[h], gyh = gy[q].part[h];
            left[q][0].part[h] = D[0] * gxh + D[1] * gyh;
            left[q][1].part[h] = D[1] * gxh + D[5] * gyh;
            left[q][2].part[h] = D[2] * gxh + D[6] * gyh;
            left[q][3].part[h] = D[3] * gxh + D[7] * gyh;
            left[q][4].part[h] = D[9] * gxh + D[10] * gyh;
            left[q][5].part[h] = D[10] * gxh + D[12] * gyh;
            vector volume_x = D[4] * gxh + D[8] * gyh, volume_y = D[11] * gxh + D[13] * gyh;
            for (int m = 0; m < 3; ++m) {
                A->pressure[m].component[0].part[h] += at->pressure[m].at[q] * volume_x;
                A->pressure[m].component[1].part[h] += at->pressure[m].at[q] * volume_y;
            }
        }
        for (int m = 0; m < 3; ++m)
            for (int n = 0; n < 3; ++n)
                A->compressibility[m][n] += at->pressure[m].at[q] * at->pressure[n].at[q] * D[14];
    }
    for (int a = 0; a < SHAPES; ++a) {
        eight xx = {{{0.0}}}, xy = {{{0.0}}}, yy = {{{0.0}}};
        for (int q = 0; q < POINTS; ++q)
            for (int h = 0; h < PARTS; ++h) {
                vector gxh = gx[q].part[h], gyh = gy[q].part[h];
                xx.part[h] += left[q][0].at[a] * gxh + left[q][1].at[a] * gyh;
                xy.part[h] += left[q][2].at[a] * gxh + left[q][3].at[a] * gyh;
                yy.part[h] += left[q][4].at[a] * gxh + left[q][5].at[a] * gyh;
            }
        if (t->foundation && t->foundation[cell] != 0.0)
            for (int q = 0; q < POINTS; ++q)
                for (int h = 0; h < PARTS; ++h) {
                    vector mass = s.area.at[q] * t->foundation[cell] * at->shape[q].at[a] *
                                  at->shape[q].part[h];
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
