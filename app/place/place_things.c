#include "app/place/place_things.h"

#include "base/linear_algebra.h"
#include "recording/recorded_things.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double CHI_95 = 2.7955; // square root of the 95 % quantile of chi^2 with 3 degrees of freedom

static void matrix_of(const struct covariance3 *c, double m[3][3])
{
    const double rows[3][3] = {{c->xx, c->xy, c->xz}, {c->xy, c->yy, c->yz}, {c->xz, c->yz, c->zz}};
    memcpy(m, rows, sizeof rows);
}

// Eigenvalues and vectors (columns) of a symmetric matrix, by Jacobi's rotations.
static void eigen(double m[3][3], double vectors[3][3])
{
    for (int i = 0; i < 9; i++)
        vectors[i / 3][i % 3] = i / 3 == i % 3;
    for (int sweep = 0; sweep < 24; sweep++) {
        const int p = sweep % 3 == 2, q = sweep % 3 == 0 ? 1 : 2;
        if (fabs(m[p][q]) < 1e-30)
            continue;
        const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
        const double t = (theta >= 0 ? 1 : -1) / (fabs(theta) + sqrt(theta * theta + 1));
        const double c = 1 / sqrt(t * t + 1), s = t * c;
        for (int k = 0; k < 3; k++) {
            const double a = m[k][p], b = m[k][q];
            m[k][p] = c * a - s * b, m[k][q] = s * a + c * b;
        }
        for (int k = 0; k < 3; k++) {
            const double a = m[p][k], b = m[q][k], d = vectors[k][p], e = vectors[k][q];
            m[p][k] = c * a - s * b, m[q][k] = s * a + c * b;
            vectors[k][p] = c * d - s * e, vectors[k][q] = s * d + c * e;
        }
    }
}

void covariance_ellipsoid(const struct covariance3 *c, struct vec3 axes[3])
{
    double m[3][3], v[3][3];
    matrix_of(c, m);
    eigen(m, v);
    for (int i = 0; i < 3; i++)
        axes[i] = v3_scale(v3(v[0][i], v[1][i], v[2][i]), CHI_95 * sqrt(fmax(m[i][i], 0)));
    for (int i = 0; i < 2; i++)
        for (int k = i + 1; k < 3; k++)
            if (v3_length(axes[k]) > v3_length(axes[i])) {
                const struct vec3 a = axes[i];
                axes[i] = axes[k];
                axes[k] = a;
            }
}

double covariance_largest_sigma(const struct covariance3 *c)
{
    struct vec3 axes[3];
    covariance_ellipsoid(c, axes);
    return v3_length(axes[0]) / CHI_95;
}

static void set_knowledge(struct place_thing *t, const char *text)
{
    t->known = text && thing_knowledge_parse(text, strlen(text), t->url, &t->knowledge) == OK;
    if (!t->known)
        t->knowledge = (struct thing_knowledge){0};
}

static void read_thing(const struct recorded_thing *from, struct place_thing *t)
{
    *t = (struct place_thing){.world_from_thing = from->world_from_thing,
                              .covariance = from->covariance,
                              .width_m = from->width_m,
                              .height_m = from->height_m,
                              .sigma_m = covariance_largest_sigma(&from->covariance),
                              .sightings = from->sightings,
                              .gone = from->gone};
    strcpy(t->name, from->name);
    strcpy(t->note, from->note);
    strcpy(t->url, from->url);
    strcpy(t->etag, from->etag);
    set_knowledge(t, from->knowledge);
    if (from->image.bytes && image_decode(from->image.bytes, from->image.count, t->name, &t->picture) != OK)
        t->picture = (struct image){0};
    if (from->model.bytes && glb_read(from->model.bytes, from->model.count, &t->model) != OK)
        t->model = (struct glb_model){0};
}

enum status place_things_read(struct recording *r, struct place_things *out)
{
    struct recorded_thing *recorded;
    int count;
    *out = (struct place_things){0};
    enum status status = recording_read_things(r, &recorded, &count);
    if (status != OK)
        return status;
    out->things = calloc((size_t)count + 1, sizeof *out->things);
    if (!out->things)
        status = fail(ERR_MEMORY, "no memory for what stands in the room");
    for (int i = 0; i < count && status == OK; i++)
        read_thing(&recorded[i], &out->things[out->count++]);
    recorded_things_free(&recorded, count);
    return status;
}

void place_things_free(struct place_things *t)
{
    for (int i = 0; i < t->count; i++) {
        free(t->things[i].picture.rgb);
        glb_model_free(&t->things[i].model);
    }
    free(t->things);
    *t = (struct place_things){0};
}
