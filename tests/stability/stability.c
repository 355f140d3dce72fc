// Runs a hard case and judges its answers.
#include "tests/stability/stability.h"

#include <math.h>
#include <string.h>

const char *const answer_kind_names[] = {"value", "ambiguous", "unknown", "error"};

static const struct stability_stage *const stages[] = {
    &stability_math,    &stability_geometry, &stability_lens, &stability_tags,    &stability_camera,
    &stability_mapping, &stability_depth,    &stability_body, &stability_avatar,  &stability_retrieval,
    &stability_drawing, &stability_compare,  &stability_time, &stability_readers, &stability_recording,
};

struct answer answer_value(double value) { return answer_values(&value, 1); }

struct answer answer_values(const double *values, int count)
{
    struct answer a = {.kind = ANSWER_VALUE, .count = count};
    assert(count <= ANSWER_VALUES);
    memcpy(a.value, values, (size_t)count * sizeof *values);
    return a;
}

struct answer answer_status(enum status status, double value)
{
    switch (status) {
    case OK: return answer_value(value);
    case NOTHING: return answer_of(ANSWER_UNKNOWN);
    case AMBIGUOUS: return answer_of(ANSWER_AMBIGUOUS);
    default: return *status_message() ? answer_of(ANSWER_ERROR) : answer_value(NAN); // an error has a sentence
    }
}

// ------------------------------------------------------------- the formula

static void reference_of(const struct stability_case *c, quad out[ANSWER_VALUES], int *count)
{
    quad in[CASE_INPUTS];
    if (c->exact_count || !c->plain) {
        *count = c->exact_count;
        for (int i = 0; i < c->exact_count; i++)
            out[i] = c->exact[i];
        return;
    }
    for (int i = 0; i < CASE_INPUTS; i++)
        in[i] = c->in[i];
    c->plain->reference(in, out);
    *count = c->plain->values;
}

static struct answer plain_in_double(const struct stability_case *c)
{
    double out[ANSWER_VALUES];
    c->plain->in_double(c->in, out);
    return answer_values(out, c->plain->values);
}

static struct answer plain_in_float(const struct stability_case *c)
{
    float in[CASE_INPUTS], out[ANSWER_VALUES];
    double wide[ANSWER_VALUES];
    for (int i = 0; i < CASE_INPUTS; i++)
        in[i] = (float)c->in[i];
    c->plain->in_float(in, out);
    for (int i = 0; i < c->plain->values; i++)
        wide[i] = out[i];
    return answer_values(wide, c->plain->values);
}

// max over the inputs of |x| |df / dx| / |f|, by central differences in 113 bits.
static double condition_of(const struct stability_case *c)
{
    quad in[CASE_INPUTS], at[ANSWER_VALUES], low[ANSWER_VALUES], high[ANSWER_VALUES], length = 0;
    double worst = 0;
    if (!c->plain)
        return NAN;
    for (int i = 0; i < CASE_INPUTS; i++)
        in[i] = c->in[i];
    c->plain->reference(in, at);
    for (int v = 0; v < c->plain->values; v++)
        length += at[v] * at[v];
    for (int i = 0; i < c->plain->inputs; i++) {
        const quad x = in[i], step = quad_abs(x) * (quad)1e-9;
        if (x == 0 || c->plain == &plain_sum_of_steps)
            continue;
        quad square = 0;
        in[i] = x + step;
        c->plain->reference(in, high);
        in[i] = x - step;
        c->plain->reference(in, low);
        in[i] = x;
        for (int v = 0; v < c->plain->values; v++)
            square += (high[v] - low[v]) * (high[v] - low[v]);
        const double k = (double)(quad_sqrt(square / length) * quad_abs(x) / (2 * step));
        if (!(k <= worst))
            worst = isnan(k) ? INFINITY : k;
    }
    return worst;
}

// ------------------------------------------------------------- judging

// The largest difference from the reference; NaN where there is none to compare.
static double error_of(const struct answer *a, const quad *reference, int count)
{
    double largest = 0;
    if (a->kind != ANSWER_VALUE || !count)
        return NAN;
    if (a->count != count)
        return INFINITY;
    for (int i = 0; i < count; i++) {
        const double e = (double)quad_abs((quad)a->value[i] - reference[i]);
        const bool same = (double)reference[i] == a->value[i]; // infinities
        if (!same && !(e <= largest))
            largest = isnan(e) ? INFINITY : e;
    }
    return largest;
}

static bool is_right(const struct stability_case *c, const struct answer *a, const quad *reference, int count)
{
    if (a->kind != c->expected)
        return false;
    return c->expected != ANSWER_VALUE || error_of(a, reference, count) <= c->tolerance;
}

static const struct stability_case *case_at(int index, const struct stability_stage **stage)
{
    for (size_t s = 0; s < COUNT_OF(stages); s++) {
        *stage = stages[s];
        if (index < stages[s]->count)
            return &stages[s]->cases[index];
        index -= stages[s]->count;
    }
    return NULL;
}

int stability_case_count(void)
{
    int count = 0;
    for (size_t s = 0; s < COUNT_OF(stages); s++)
        count += stages[s]->count;
    return count;
}

struct stability_result stability_run(int index)
{
    struct stability_result r = {.float_error = NAN, .double_error = NAN};
    const struct stability_case *c = r.of = case_at(index, &r.stage);
    quad reference[ANSWER_VALUES] = {0};
    int count = 0;
    assert(c && (c->plain || c->unguarded));
    reference_of(c, reference, &count);
    for (int i = 0; i < count; i++)
        r.reference[i] = (double)reference[i];
    r.shipped = c->shipped(c->in);
    r.unguarded = c->unguarded ? c->unguarded(c->in) : c->guard_is_double ? plain_in_float(c) : plain_in_double(c);
    r.right = is_right(c, &r.shipped, reference, count);
    r.silent = !r.right && r.shipped.kind != ANSWER_ERROR && r.shipped.kind != ANSWER_UNKNOWN;
    r.guard_seen = !is_right(c, &r.unguarded, reference, count);
    r.error = error_of(&r.shipped, reference, count);
    if (c->plain && c->plain->values == count) {
        const struct answer single = plain_in_float(c), twice = plain_in_double(c);
        r.float_error = error_of(&single, reference, count);
        r.double_error = error_of(&twice, reference, count);
    }
    r.condition = condition_of(c);
    return r;
}

// ------------------------------------------------------------- text

void stability_print_answer(char *out, size_t bytes, const struct answer *a, int digits)
{
    if (a->kind != ANSWER_VALUE) {
        snprintf(out, bytes, "%s", answer_kind_names[a->kind]);
        return;
    }
    size_t used = 0;
    *out = 0;
    for (int i = 0; i < a->count && used < bytes; i++) {
        const double v = a->value[i];
        if (isnan(v)) // its sign is not the same everywhere
            used += (size_t)snprintf(out + used, bytes - used, "%snan", i ? " " : "");
        else
            used += (size_t)snprintf(out + used, bytes - used, "%s%.*g", i ? " " : "", digits, v);
    }
}

void stability_print_stored(char *out, size_t bytes, const struct stability_result *r)
{
    char answer[256];
    if (r->of->foreign && r->shipped.kind == ANSWER_VALUE)
        snprintf(answer, sizeof answer, "value");
    else
        stability_print_answer(answer, sizeof answer, &r->shipped, 17);
    snprintf(out, bytes, "%s | %s | %s | %s", r->stage->name, r->of->asked, answer, r->right ? "right" : "WRONG");
}
