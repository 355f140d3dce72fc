#include "compare/score.h"

#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

// Natural spreads, see score.h; left and right together. Offsets in rad, courses as shares, ranges as logarithms.
static const double spread[SCORED_LINES][DEVIATIONS] = {
    [PART_HEAD] = {0.24, 0.41, 0.15},
    [PART_UPPER_TORSO] = {0.12, 0.33, 0.16},
    [PART_LOWER_TORSO] = {0.18, 0.34, 0.16},
    [PART_LEFT_UPPER_ARM] = {0.30, 0.41, 0.13},
    [PART_RIGHT_UPPER_ARM] = {0.30, 0.41, 0.13},
    [PART_LEFT_FOREARM] = {0.41, 0.49, 0.22},
    [PART_RIGHT_FOREARM] = {0.41, 0.49, 0.22},
    [PART_LEFT_THIGH] = {0.41, 0.48, 0.43},
    [PART_RIGHT_THIGH] = {0.41, 0.48, 0.43},
    [PART_LEFT_SHIN] = {0.34, 0.48, 0.52},
    [PART_RIGHT_SHIN] = {0.34, 0.48, 0.52},
    [LINE_SHOULDERS] = {0.10, 0.28, 0.16}, // the range is the torso's: in those exercises nobody turns
};
// Variance, rad^2 (10 degrees): of a part that moves less, course and range say little.
static const double MOVED_FLOOR = 0.03;
static const double LARGER_SHARE = 0.5; // of a range that is too large
static const double TRUNK_SHARE = 0.5;
// By hand: limbs weigh as if each moved by 3 degrees at least.
static const double MIN_MOVED_RAD = 0.05;

// The shoulders' line is the upper torso's second one.
static int part_of_line(int line) { return line == LINE_SHOULDERS ? PART_UPPER_TORSO : line; }

static bool is_trunk(int p) { return p == PART_HEAD || p == PART_UPPER_TORSO || p == PART_LOWER_TORSO; }

double natural_offset_rad(enum part part) { return spread[part][DEVIATION_OFFSET]; }

double robust_cost(double z) { return z * z / (1 + z * z); }

double score_from_terms(const struct score_terms *terms)
{
    double weight = 0;
    for (int p = 0; p < PART_COUNT; p++)
        weight += terms->part[p].weight;
    if (!(weight > 0))
        return 0;
    const double right =
        (1 - terms->posture) * (1 - terms->missing_share) * (1 - terms->extra_share) * (1 - terms->findings);
    return 100 * fmax(0, right);
}

// ---------------------------------------------------------------- directions of parts against their carriers

struct carried_directions {
    double direction[SCORED_LINES][3];
    uint16_t known;
};

static void put_direction(struct carried_directions *out, int p, struct vec3 d)
{
    out->direction[p][0] = d.x;
    out->direction[p][1] = d.y;
    out->direction[p][2] = d.z;
    out->known |= (uint16_t)(1u << p);
}

static void put_limb(struct carried_directions *out, const struct movement_frame *frame, struct quat carrier, int upper)
{
    const int lower = upper + 1; // recording/skeleton.h's order
    if (!(frame->known >> upper & 1))
        return;
    const struct vec3 x = quat_rotate(carrier, vec3_from_floats(frame->direction[upper]));
    put_direction(out, upper, x);
    if (frame->known >> lower & 1)
        put_direction(out, lower,
                      quat_rotate(quat_between(x, v3(0, 0, -1)),
                                  quat_rotate(carrier, vec3_from_floats(frame->direction[lower]))));
}

static struct carried_directions carried_directions_of(const struct movement_frame *frame)
{
    const struct quat none = {0, 0, 0, 1};
    struct carried_directions out = {.known = 0};
    struct quat chest;
    for (int p = 0; p < PART_COUNT; p++)
        if (is_trunk(p) && (frame->known >> p & 1))
            put_direction(&out, p, vec3_from_floats(frame->direction[p]));
    if (frame->known >> LINE_SHOULDERS & frame->known >> PART_UPPER_TORSO & 1)
        put_direction(&out, LINE_SHOULDERS, vec3_from_floats(frame->shoulders));
    if (chest_from_upright(frame, &chest)) {
        put_limb(&out, frame, chest, PART_LEFT_UPPER_ARM);
        put_limb(&out, frame, chest, PART_RIGHT_UPPER_ARM);
    }
    put_limb(&out, frame, none, PART_LEFT_THIGH);
    put_limb(&out, frame, none, PART_RIGHT_THIGH);
    return out;
}

// ---------------------------------------------------------------- sums over the pairs

static void add_pair(struct pair_moments *m, const double a[3], const double b[3])
{
    m->count++;
    for (int k = 0; k < 3; k++) {
        m->a[k] += a[k];
        m->b[k] += b[k];
        m->aa += a[k] * a[k];
        m->bb += b[k] * b[k];
        m->ab += a[k] * b[k];
    }
}

void pair_sums_add(struct pair_sums *sums, const struct movement *a, const struct movement *b,
                   const struct alignment *x)
{
    for (int32_t k = 0; k < x->count; k++) {
        const struct movement_frame *in_a = &a->frames[x->pairs[k].a], *in_b = &b->frames[x->pairs[k].b];
        const struct carried_directions ca = carried_directions_of(in_a), cb = carried_directions_of(in_b);
        for (int p = 0; p < SCORED_LINES; p++) {
            if (sums->ignored >> part_of_line(p) & 1)
                continue;
            if (ca.known & cb.known & 1u << p)
                add_pair(&sums->carried[p], ca.direction[p], cb.direction[p]);
            if (p < PART_COUNT && in_a->known & in_b->known & 1u << p) {
                const double da[3] = {in_a->direction[p][0], in_a->direction[p][1], in_a->direction[p][2]},
                             db[3] = {in_b->direction[p][0], in_b->direction[p][1], in_b->direction[p][2]};
                add_pair(&sums->upright[p], da, db);
            }
        }
    }
}

// Between directions so many frames apart the joints' noise is nearly independent (movement.h smooths by 1.5 frames);
// a part that moves faster than 100 degrees a second is not asked. The middle of two has half their variance; what the
// smoothing leaves in common takes off about as much again.
enum { NOISE_STEP = 3 };
static const double NOISE_MAX_CHORD = 0.35, NOISE_SHARE = 0.9;

static double squared_distance(const double x[3], const double y[3], double share_y)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += (x[k] - share_y * y[k]) * (x[k] - share_y * y[k]);
    return sum;
}

static void add_noise(struct noise_sum *sum, const double before[3], const double d[3], const double after[3])
{
    const double both[3] = {before[0] + after[0], before[1] + after[1], before[2] + after[2]};
    if (squared_distance(before, after, 1) > NOISE_MAX_CHORD * NOISE_MAX_CHORD)
        return;
    sum->sum += squared_distance(d, both, 0.5) / NOISE_SHARE;
    sum->count++;
}

void noise_sums_add(struct noise_sum sums[SCORED_LINES], const struct movement *movement, int32_t first, int32_t end)
{
    enum { KEPT = 2 * NOISE_STEP + 1 };
    struct carried_directions last[KEPT] = {{.known = 0}};
    for (int32_t f = first; f < end; f++) {
        struct carried_directions *d = &last[f % KEPT];
        *d = carried_directions_of(&movement->frames[f]);
        const struct carried_directions *middle = &last[(f + KEPT - NOISE_STEP) % KEPT],
                                        *before = &last[(f + 1) % KEPT];
        for (int p = 0; p < SCORED_LINES; p++) {
            if (f - first >= KEPT - 1 && (d->known & middle->known & before->known & 1u << p))
                add_noise(&sums[p], before->direction[p], middle->direction[p], d->direction[p]);
        }
    }
}

static double product(const double x[3], const double y[3], double count)
{
    return (x[0] * y[0] + x[1] * y[1] + x[2] * y[2]) / (count * count);
}

struct spreads {
    double variance_a, variance_b, covariance, offset2, course2; // rad^2; course2: the variance of the differences
};

static struct spreads spreads_of(const struct pair_moments *m)
{
    const double n = m->count;
    struct spreads s = {fmax(0, m->aa / n - product(m->a, m->a, n)), fmax(0, m->bb / n - product(m->b, m->b, n)),
                        m->ab / n - product(m->a, m->b, n), 0, 0};
    s.offset2 = fmax(0, product(m->a, m->a, n) + product(m->b, m->b, n) - 2 * product(m->a, m->b, n));
    s.course2 = fmax(0, s.variance_a + s.variance_b - 2 * s.covariance);
    return s;
}

static double noise_variance(const struct noise_sum *noise) { return noise->sum / fmax(1, noise->count); }

static void take_off_noise(struct spreads *s, const struct noise_sum *a, const struct noise_sum *b)
{
    const double noise_a = noise_variance(a), noise_b = noise_variance(b);
    s->variance_a = fmax(0, s->variance_a - noise_a);
    s->variance_b = fmax(0, s->variance_b - noise_b);
    s->course2 = fmax(0, s->course2 - noise_a - noise_b);
}

// natural: the line's spreads, or what is expected instead of them.
static void measure_line(const struct spreads *s, const double natural[DEVIATIONS], struct part_deviation *out)
{
    const double ratio = 0.5 * portable_log((s->variance_b + MOVED_FLOOR) / (s->variance_a + MOVED_FLOOR));
    out->z[DEVIATION_OFFSET] = sqrt(s->offset2) / natural[DEVIATION_OFFSET];
    out->z[DEVIATION_COURSE] =
        sqrt(s->course2 / (s->variance_a + s->variance_b + MOVED_FLOOR)) / natural[DEVIATION_COURSE];
    out->z[DEVIATION_RANGE] = (ratio > 0 ? LARGER_SHARE * ratio : -ratio) / natural[DEVIATION_RANGE];
    out->cost = 0;
    for (int k = 0; k < DEVIATIONS; k++)
        out->cost += robust_cost(out->z[k]) / DEVIATIONS;
}

// Two lines of one part: it costs what they do in the mean, and is off by as much as the one that is off most.
static void merge_lines(struct part_deviation *part, const struct part_deviation *line)
{
    const double weight = part->weight + line->weight;
    if (!(weight > 0))
        return;
    for (int k = 0; k < DEVIATIONS; k++)
        part->z[k] = fmax(part->z[k], line->z[k]);
    part->cost = (part->weight * part->cost + line->weight * line->cost) / weight;
    part->weight = weight;
}

// Is it known in a tenth of the pairs that know most?
static bool is_line_scored(const struct pair_sums *sums, int line)
{
    double most = 0;
    for (int p = 0; p < SCORED_LINES; p++)
        most = fmax(most, sums->carried[p].count);
    return sums->carried[line].count > 0 && 10 * sums->carried[line].count >= most;
}

// A line's spreads, or what is expected instead of them; by NULL: nothing is.
struct line_spreads {
    double natural[DEVIATIONS];
};
static struct line_spreads expected_spreads(int line, const struct tolerances *by)
{
    struct line_spreads out;
    for (int k = 0; k < DEVIATIONS; k++)
        out.natural[k] = (by ? by->spread[part_of_line(line)][k] : 1) * spread[line][k];
    return out;
}

// Of a line; zeroed where it is hardly ever known.
static struct part_deviation line_deviation(const struct pair_sums *sums, int line, const double *moved,
                                            const struct tolerances *by)
{
    struct part_deviation out = {.weight = 0};
    const int part = part_of_line(line);
    const struct line_spreads spreads = expected_spreads(line, by);
    if (!is_line_scored(sums, line))
        return out;
    struct spreads s = spreads_of(&sums->carried[line]);
    take_off_noise(&s, &sums->noise[0][line], &sums->noise[1][line]);
    measure_line(&s, spreads.natural, &out);
    out.weight = is_trunk(part) ? 1 : (moved ? moved[part] : sqrt(s.variance_a)) + MIN_MOVED_RAD;
    return out;
}

struct score_terms score_posture(const struct pair_sums *sums, const double *moved, const struct tolerances *by)
{
    struct score_terms terms = {.posture = 0};
    double sum[2] = {0};
    for (int p = 0; p < SCORED_LINES; p++) {
        const struct part_deviation line = line_deviation(sums, p, moved, by);
        merge_lines(&terms.part[part_of_line(p)], &line);
        sum[is_trunk(part_of_line(p))] += line.weight;
    }
    for (int p = 0; p < PART_COUNT; p++) {
        const bool trunk = is_trunk(p);
        const double of_body = trunk ? TRUNK_SHARE : 1 - TRUNK_SHARE, share = sum[!trunk] > 0 ? of_body : 1;
        if (terms.part[p].weight > 0)
            terms.part[p].weight *= share / sum[trunk];
        terms.posture += terms.part[p].weight * terms.part[p].cost;
    }
    return terms;
}

// Seconds for which a tracker's error stays what it is. By hand.
static const double ERROR_S = 1;

// What errors of a line's directions (variance: rad^2 about each axis across, of both movements) may add to its cost.
static double line_cost_error(const struct pair_sums *sums, int line, double variance, const double natural[DEVIATIONS])
{
    const double pieces = fmax(1, sums->carried[line].count / (ERROR_S * MOVEMENT_RATE_HZ));
    const struct noise_sum *noise_a = &sums->noise[0][line], *noise_b = &sums->noise[1][line];
    struct part_deviation x = {.weight = 0};
    struct spreads s = spreads_of(&sums->carried[line]);
    take_off_noise(&s, noise_a, noise_b);
    measure_line(&s, natural, &x);
    const double slow = fmax(0, 2 * variance - noise_variance(noise_a) - noise_variance(noise_b)), // two axes
        error[DEVIATIONS] = {sqrt(2 * variance / pieces) / natural[DEVIATION_OFFSET],
                             sqrt(slow / (s.variance_a + s.variance_b + MOVED_FLOOR)) / natural[DEVIATION_COURSE],
                             0.5 * slow / (s.variance_a + MOVED_FLOOR) / sqrt(pieces) / natural[DEVIATION_RANGE]};
    // Errors make deviations larger: without them it would be as much less, by chance it is as much more.
    double sum = 0;
    for (int k = 0; k < DEVIATIONS; k++) {
        const double z2 = x.z[k] * x.z[k], error2 = error[k] * error[k], cost = robust_cost(x.z[k]);
        sum += fmax(cost - robust_cost(sqrt(fmax(0, z2 - error2))), robust_cost(sqrt(z2 + error2)) - cost) / DEVIATIONS;
    }
    return sum;
}

double score_error(const struct score_terms *terms, const struct pair_sums *sums, const struct movement *a,
                   const struct movement *b, const struct tolerances *by)
{
    double sum = 0;
    if (!a->sigma_given || !b->sigma_given)
        return NAN;
    for (int line = 0; line < SCORED_LINES; line++) {
        const int part = part_of_line(line);
        // The shoulders are as far apart as the trunk is long, and taken for as exact.
        const double sa = a->sigma_typical[part], sb = b->sigma_typical[part];
        const bool two = part == PART_UPPER_TORSO && is_line_scored(sums, LINE_SHOULDERS);
        const struct line_spreads spreads = expected_spreads(line, by);
        if (is_line_scored(sums, line))
            sum += terms->part[part].weight / (two ? 2 : 1) *
                   line_cost_error(sums, line, sa * sa + sb * sb, spreads.natural);
    }
    return 100 * sum * (1 - terms->missing_share) * (1 - terms->extra_share) * (1 - terms->findings);
}

// What slow errors of a part add to the variance of its directions, rad^2. jitter: of the part, where nothing is given.
static double slow_variance(const struct movement *movement, int part, const struct noise_sum *noise, double jitter)
{
    const double sigma = movement->sigma_typical[part];
    return movement->sigma_given ? fmax(0, 2 * sigma * sigma - noise_variance(noise)) : jitter; // two axes
}

struct similarity similarity_of(const struct pair_sums *sums, const struct movement *a, const struct movement *b)
{
    struct spreads sum = {0};
    double parts = 0, square = 0, moved_a = 0, moved_b = 0, error_a = 0, error_b = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        if (!(sums->upright[p].count > 0))
            continue;
        const struct spreads s = spreads_of(&sums->upright[p]);
        struct spreads still = s;
        take_off_noise(&still, &sums->noise[0][p], &sums->noise[1][p]);
        moved_a += still.variance_a;
        moved_b += still.variance_b;
        // Of one that moves quickly, a part of that is taken for noise.
        const struct noise_sum *noise_a = &sums->noise[0][p], *noise_b = &sums->noise[1][p];
        const double jitter = fmin(noise_variance(noise_a), noise_variance(noise_b));
        error_a += slow_variance(a, p, noise_a, jitter);
        error_b += slow_variance(b, p, noise_b, jitter);
        sum.variance_a += s.variance_a;
        sum.variance_b += s.variance_b;
        sum.covariance += s.covariance;
        square += s.offset2 + s.course2;
        parts++;
    }
    if (!(parts > 0))
        return (struct similarity){0};
    return (struct similarity){.correlation = sum.covariance / sqrt(fmax(1e-12, sum.variance_a * sum.variance_b)),
                               .rms_rad = sqrt(square / parts),
                               .moved_a_rad = sqrt(moved_a / parts),
                               .moved_b_rad = sqrt(moved_b / parts),
                               .error_a_rad = sqrt(error_a / parts),
                               .error_b_rad = sqrt(error_b / parts)};
}
