#include "capture/body_system.h"

void fit_row_start(struct fit_row *row, const struct body_build *build, enum segment segment, struct vec3 point,
                   struct vec3 n)
{
    row->count = 3;
    row->index[0] = 0, row->index[1] = 1, row->index[2] = 2;
    row->value[0] = n.x, row->value[1] = n.y, row->value[2] = n.z;
    for (int s = (int)segment; s >= 0; s = body_parent((enum segment)s)) {
        struct vec3 turn = v3_cross(v3_sub(point, build->origin[s]), n);
        const double(*m)[3] = (const double(*)[3])build->parent_axes[s];
        for (int k = 0; k < 3; k++) {
            row->index[row->count] = 3 + 3 * s + k;
            row->value[row->count++] = m[0][k] * turn.x + m[1][k] * turn.y + m[2][k] * turn.z;
        }
    }
}

void fit_system_add(struct fit_system *s, const struct fit_row *row, double residual, double weight)
{
    for (int a = 0; a < row->count; a++) {
        double wa = weight * row->value[a];
        if (wa == 0)
            continue;
        int ia = row->index[a];
        s->g[ia] += wa * residual;
        for (int b = 0; b < row->count; b++)
            if (row->index[b] <= ia)
                s->h[ia][row->index[b]] += wa * row->value[b];
    }
}

void fit_system_pull(struct fit_system *s, const struct body_build *build, enum segment segment, struct vec3 point,
                     struct vec3 n, double residual, double weight)
{
    struct fit_row row;
    if (!s)
        return;
    fit_row_start(&row, build, segment, point, n);
    fit_system_add(s, &row, residual, weight);
}

bool fit_system_solve(const struct fit_system *s, double damping, double x[FIT_COUNT])
{
    int n = s->count;
    double l[FIT_COUNT][FIT_COUNT];
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = s->h[i][j] + (i == j ? damping * s->h[i][i] + 1e-3 : 0);
            for (int k = 0; k < j; k++)
                sum -= l[i][k] * l[j][k];
            if (i == j) {
                if (!(sum > 1e-9))
                    return false;
                l[i][i] = sqrt(sum);
            } else {
                l[i][j] = sum / l[j][j];
            }
        }
    }
    for (int i = 0; i < n; i++) {
        double sum = s->g[i];
        for (int k = 0; k < i; k++)
            sum -= l[i][k] * x[k];
        x[i] = sum / l[i][i];
    }
    for (int i = n - 1; i >= 0; i--) {
        double sum = x[i];
        for (int k = i + 1; k < n; k++)
            sum -= l[k][i] * x[k];
        x[i] = sum / l[i][i];
    }
    return true;
}

void fit_system_shape(const struct fit_system *s, double information[SHAPE_COUNT][SHAPE_COUNT])
{
    double l[FIT_COUNT][FIT_COUNT];
    for (int i = 0; i < FIT_COUNT; i++)
        for (int j = 0; j <= i; j++) {
            double sum = s->h[i][j] + (i == j ? 1e-3 : 0);
            int last = j < FIT_POSE_COUNT ? j : FIT_POSE_COUNT;
            for (int k = 0; k < last; k++)
                sum -= l[i][k] * l[j][k];
            if (i < FIT_POSE_COUNT && i == j)
                l[i][i] = sqrt(fmax(sum, 1e-9));
            else
                l[i][j] = j < FIT_POSE_COUNT ? sum / l[j][j] : sum;
        }
    for (int a = 0; a < SHAPE_COUNT; a++)
        for (int b = 0; b <= a; b++)
            information[a][b] = information[b][a] = l[FIT_POSE_COUNT + a][FIT_POSE_COUNT + b];
}
