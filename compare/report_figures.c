// The page's pictures of the worst moments: people where they were given, else stick figures.
#include "compare/report_internal.h"

#include "compare/findings.h"

#include "base/html.h"
#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

// ------------------------------------------------------------- which moments

// From the front and a little from the part's own side; nearly from the side where the part is too far forwards or
// back.
static double azimuth_of(const struct comparison *c, int32_t frame, int part)
{
    if (part < 0)
        return -0.35;
    const int judged = judged_part(c, part);
    const struct movement_frame a = movement_at(&c->a, c->timeline.reference[frame]), *b = &c->judged.frames[frame];
    double d[3];
    for (int k = 0; k < 3; k++)
        d[k] = fabs((double)b->direction[judged][k] - a.direction[judged][k]);
    const double turned = d[1] > d[0] && d[1] > 0.7 * d[2] ? 1.1 : 0.35;
    return strncmp(part_name((enum part)part), "left", 4) ? -turned : turned;
}

int report_moments(const struct comparison *c, struct report_moment moments[REPORT_MOMENTS])
{
    int count = 0;
    for (int32_t k = 0; k < c->finding_count && count < REPORT_MOMENTS; k++) {
        const struct finding *f = &c->findings[k];
        const int part = part_by_name(f->part);
        const int32_t at = (int32_t)lround(finding_worst_s(c, f) * MOVEMENT_RATE_HZ);
        if ((f->kind != FINDING_POSTURE && f->kind != FINDING_RANGE && f->kind != FINDING_MIRRORED) ||
            at >= c->b.count || isnan(c->timeline.reference[at]))
            continue;
        const double azimuth_rad = azimuth_of(c, at, part);
        moments[count++] = (struct report_moment){
            .finding = k,
            .part = part,
            .attempt_s = at / MOVEMENT_RATE_HZ,
            .reference_s = c->timeline.reference[at] / MOVEMENT_RATE_HZ,
            .attempt_azimuth_rad = azimuth_rad,
            .reference_azimuth_rad = part >= 0 && c->mirrored ? -azimuth_rad : azimuth_rad,
        };
    }
    return count;
}

void report_moments_free(struct report_moment *moments, int count)
{
    for (int k = 0; k < count; k++) {
        free(moments[k].attempt.png);
        free(moments[k].reference.png);
    }
}

// ------------------------------------------------------------- stick figures

// Unit bones of an average build, in the person's own frame, 100 units high.
struct point {
    double x, y, z;
};

static struct point along(struct point from, const float d[3], double length)
{
    return (struct point){from.x + length * d[0], from.y + length * d[1], from.z + length * d[2]};
}

// Where and from which side a figure is drawn. From the front the person's left is on the viewer's right.
struct stand {
    double centre, right_x, right_y;
};

static struct stand stand_of(double centre, double azimuth_rad)
{
    return (struct stand){centre, portable_cos(azimuth_rad), -portable_sin(azimuth_rad)};
}

static void bone(FILE *to, struct point a, struct point b, const char *class, const struct stand *s)
{
    fprintf(to, "<line class=\"bone %s\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>", class,
            s->centre + s->right_x * a.x + s->right_y * a.y, 62 - a.z, s->centre + s->right_x * b.x + s->right_y * b.y,
            62 - b.z);
}

static void figure(FILE *to, const struct movement_frame *f, const char *class, int bad, const struct stand *s)
{
    static const double length[PART_COUNT] = {
        [PART_HEAD] = 11,         [PART_UPPER_TORSO] = 15,     [PART_LOWER_TORSO] = 12,   [PART_LEFT_UPPER_ARM] = 17,
        [PART_LEFT_FOREARM] = 15, [PART_RIGHT_UPPER_ARM] = 17, [PART_RIGHT_FOREARM] = 15, [PART_LEFT_THIGH] = 24,
        [PART_LEFT_SHIN] = 23,    [PART_RIGHT_THIGH] = 24,     [PART_RIGHT_SHIN] = 23,
    };
    const struct point waist = {0, 0, 0};
    struct point torso = along(waist, f->direction[PART_LOWER_TORSO], length[PART_LOWER_TORSO]);
    struct point neck = along(torso, f->direction[PART_UPPER_TORSO], length[PART_UPPER_TORSO]);
    struct point ends[PART_COUNT];
    for (int p = 0; p < PART_COUNT; p++) {
        struct point from = waist;
        const bool left = !strncmp(part_name((enum part)p), "left", 4);
        const double aside = left ? 1 : -1;
        if (p == PART_UPPER_TORSO)
            from = torso;
        else if (p == PART_HEAD)
            from = neck;
        else if (p == PART_LEFT_UPPER_ARM || p == PART_RIGHT_UPPER_ARM)
            from = along(neck, f->shoulders, aside * 9);
        else if (p == PART_LEFT_FOREARM || p == PART_LEFT_SHIN || p == PART_RIGHT_FOREARM || p == PART_RIGHT_SHIN)
            from = ends[p - 1];
        else if (p == PART_LEFT_THIGH || p == PART_RIGHT_THIGH)
            from = (struct point){aside * 5, 0, -2};
        ends[p] = along(from, f->direction[p], length[p]);
        if (f->known >> p & 1)
            bone(to, from, ends[p], p == bad ? "bad" : class, s);
    }
}

// ------------------------------------------------------------- pictures

static void picture(FILE *to, const struct report_picture *p, double left)
{
    const double width = 88, height = width * p->height_px / p->width_px, scale = width / p->width_px;
    fprintf(to, "<image x=\"%.1f\" y=\"0\" width=\"%.1f\" height=\"%.1f\" href=\"data:image/png;base64,", left, width,
            height);
    html_put_base64(to, p->png, p->png_size);
    fputs("\"/>", to);
    if (p->marked)
        fprintf(to, "<line class=\"bone bad\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>",
                left + scale * p->from_px[0], scale * p->from_px[1], left + scale * p->to_px[0], scale * p->to_px[1]);
}

void report_figures(FILE *to, const struct report_attempt *a)
{
    for (int k = 0; k < a->moment_count; k++) {
        const struct report_moment *m = &a->moments[k];
        const struct comparison *c = a->c;
        const struct stand at_left = stand_of(50, m->reference_azimuth_rad),
                           at_right = stand_of(150, m->attempt_azimuth_rad);
        const struct movement_frame reference = movement_at(&c->a, m->reference_s * MOVEMENT_RATE_HZ),
                                    attempt = movement_at(&c->b, m->attempt_s * MOVEMENT_RATE_HZ);
        fputs("<figure><svg viewBox=\"0 0 200 130\"><style>.a{stroke:var(--a)}.b{stroke:var(--b)}</style>", to);
        if (m->reference.png)
            picture(to, &m->reference, 6);
        else
            figure(to, &reference, "a", -1, &at_left);
        if (m->attempt.png)
            picture(to, &m->attempt, 106);
        else
            figure(to, &attempt, "b", m->part, &at_right);
        fprintf(to,
                "<text x=\"50\" y=\"127\" text-anchor=\"middle\">reference, %.1f s</text>"
                "<text x=\"150\" y=\"127\" text-anchor=\"middle\">attempt, %.1f s</text></svg>"
                "<figcaption>%s</figcaption></figure>",
                m->reference_s, m->attempt_s, c->findings[m->finding].sentence);
    }
}
