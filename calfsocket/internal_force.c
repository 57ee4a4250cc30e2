/* Residuals of elements, added to a vector; called by internal_force.py. */

#include "cells.h"

/* Residuals of n cells, with the stresses of their law, added to the values of their unknowns. */
void add_residuals(intptr_t law, const double *element, int n, const int32_t *cells,
                   int n_functions, const int64_t *functions, const double *x,
                   const int32_t *nodes, const int32_t *dofs, double *values)
{
    for (int i = 0; i < n; ++i) {
        const int32_t *dof = dofs + (size_t)cells[i] * UNKNOWNS;
        double coordinates[NODES][3], stresses[POINTS][STRESSES] = {{0.0}};
        element_vector r;
        at_points(law, n_functions, functions, x, nodes, cells[i], coordinates, &stresses[0][0]);
        element_residual((const reference_element *)element, coordinates, stresses, &r);
        for (int a = 0; a < SHAPES; ++a) {
            values[dof[2 * a]] += r.displacement.component[0].at[a];
            values[dof[2 * a + 1]] += r.displacement.component[1].at[a];
        }
        values[dof[14]] += r.pressure[0] - r.pressure[1] - r.pressure[2];
        values[dof[15]] += r.pressure[1];
        values[dof[16]] += r.pressure[2];
    }
}
