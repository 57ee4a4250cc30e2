/* Residuals of elements, added to a vector; called by cells.py. */

#include "cells.h"

/* Residuals of n cells, added to the values of their unknowns. */
void add_residuals(int n, const int32_t *cells, const double *element, const double *x,
                   const int32_t *nodes, const double *unknowns, const int32_t *dofs,
                   const int64_t *parameters, const double *foundation,
                   const double *anchor, const double *stress_free, double *values)
{
    tissue t = {(const reference_element *)element, x, nodes, unknowns, dofs, parameters,
                foundation, anchor, stress_free};
    for (int i = 0; i < n; ++i) {
        const int32_t *dof = dofs + (size_t)cells[i] * UNKNOWNS;
        element_vector r;
        element_residual(&t, cells[i], &r);
        for (int a = 0; a < SHAPES; ++a)
            for (int c = 0; c < 2; ++c)
                values[dof[2 * a + c]] += r.displacement.component[c].at[a];
        const double *p = r.pressure;
        values[dof[2 * SHAPES]] += p[0] - p[1] - p[2];
        values[dof[2 * SHAPES + 1]] += p[1];
        values[dof[2 * SHAPES + 2]] += p[2];
    }
}
