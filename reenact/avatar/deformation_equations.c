// Linear least squares for the shifts of a deformation's nodes: rows from deformation.c and
// deformation_photometric.c, smoothness and size priors, preconditioned conjugate gradients.
#include "reenact/avatar/deformation_internal.h"

#include <string.h>

enum { STEPS = 20 }; // of conjugate gradients

// Standard deviations, metres; with the sigmas of the evidence they set its weight. Tuned by hand on the takes of
// docs/notes/avatar.md, where softer and stiffer ones were no better.
static const float SMOOTHNESS_M = 0.024F; // of the difference between neighbouring nodes' shifts
static const float SHIFT_PRIOR_M = 0.04F; // of each shift

struct vec3 deformation_current_shift(const struct deformation *w, struct vec3 bind_point)
{
    struct vec3 sum = v3(0, 0, 0);
    struct deformation_cell cell;
    if (!deformation_grid_cell(&w->grid, bind_point, &cell))
        return sum;
    for (int c = 0; c < 8; c++) {
        int node = w->node[cell.at[c]];
        if (node < 0)
            continue;
        const four s = w->shift[node];
        sum = v3_add(sum, v3_scale(v3((double)s[0], (double)s[1], (double)s[2]), cell.weight[c]));
    }
    return sum;
}

void deformation_add_row(struct deformation *w, const struct deformation_constraint *k)
{
    struct deformation_cell cell;
    if (w->row_count == w->row_most || !deformation_grid_cell(&w->grid, k->bind_point, &cell))
        return;
    struct deformation_row *r = &w->rows[w->row_count];
    for (int c = 0; c < 8; c++) {
        r->node[c] = w->node[cell.at[c]];
        r->share[c] = (float)cell.weight[c];
        if (r->node[c] < 0)
            return;
    }
    r->n = (four){(float)k->normal.x, (float)k->normal.y, (float)k->normal.z, 0};
    r->value = (float)(v3_dot(k->normal, deformation_current_shift(w, k->bind_point)) + k->gap);
    r->weight = (float)k->weight;
    w->row_count++;
}

// out = A x; A: the normal equations of the rows, of the smoothness between neighbours and of the shifts' prior.
static void multiply(const struct deformation *w, const four *x, four *out)
{
    const float shift_weight = 1 / (SHIFT_PRIOR_M * SHIFT_PRIOR_M), bend = 1 / (SMOOTHNESS_M * SMOOTHNESS_M);
    for (int i = 0; i < w->node_count; i++)
        out[i] = shift_weight * x[i];
    for (int i = 0; i < w->node_count; i++)
        for (int k = 0; k < 3; k++) {
            int j = w->neighbor[i][k];
            if (j < 0)
                continue;
            four apart = bend * (x[i] - x[j]);
            out[i] += apart;
            out[j] -= apart;
        }
    for (int r = 0; r < w->row_count; r++) {
        const struct deformation_row *row = &w->rows[r];
        four shift = {0};
        for (int c = 0; c < 8; c++)
            shift += row->share[c] * x[row->node[c]];
        shift *= row->n;
        four back = row->weight * (shift[0] + shift[1] + shift[2]) * row->n;
        for (int c = 0; c < 8; c++)
            out[row->node[c]] += row->share[c] * back;
    }
}

// The right-hand side, and the diagonal of A as preconditioner (6: of a node with all neighbours).
static void prepare(struct deformation *w)
{
    const float shift_weight = 1 / (SHIFT_PRIOR_M * SHIFT_PRIOR_M), bend = 1 / (SMOOTHNESS_M * SMOOTHNESS_M);
    memset(w->rhs, 0, sizeof *w->rhs * (size_t)w->node_count);
    for (int i = 0; i < w->node_count; i++)
        w->diagonal[i] = (four){0} + (shift_weight + 6 * bend);
    for (int r = 0; r < w->row_count; r++) {
        const struct deformation_row *row = &w->rows[r];
        for (int c = 0; c < 8; c++) {
            four j = row->share[c] * row->n;
            w->rhs[row->node[c]] += row->weight * row->value * j;
            w->diagonal[row->node[c]] += row->weight * j * j;
        }
    }
}

static double total(const four_doubles *s) { return (*s)[0] + (*s)[1] + (*s)[2] + (*s)[3]; }

// Conjugate gradients with the diagonal as preconditioner. Dot products are summed in double, in a fixed order.
void deformation_solve(struct deformation *w)
{
    const int count = w->node_count;
    four *x = w->shift, *r = w->residual, *d = w->direction, *q = w->product, *scale = w->diagonal;
    prepare(w);
    multiply(w, x, q);
    four_doubles sizes = {0};
    for (int i = 0; i < count; i++) {
        r[i] = w->rhs[i] - q[i];
        d[i] = r[i] / scale[i];
        sizes += __builtin_convertvector(r[i] * d[i], four_doubles);
    }
    double size = total(&sizes);
    for (int step = 0; step < STEPS && size > 0; step++) {
        multiply(w, d, q);
        four_doubles curves = {0}, nexts = {0};
        for (int i = 0; i < count; i++)
            curves += __builtin_convertvector(d[i] * q[i], four_doubles);
        float go = (float)(size / total(&curves));
        for (int i = 0; i < count; i++) {
            x[i] += go * d[i];
            r[i] -= go * q[i];
            nexts += __builtin_convertvector(r[i] * r[i] / scale[i], four_doubles);
        }
        double next = total(&nexts);
        float back = (float)(next / size);
        for (int i = 0; i < count; i++)
            d[i] = r[i] / scale[i] + back * d[i];
        size = next;
    }
}
