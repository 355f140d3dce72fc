#include "capture/mapping/map_advice.h"

#include <stdarg.h>
#include <stdio.h>

static void say(struct map_advice *out, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void say(struct map_advice *out, const char *format, ...)
{
    va_list list;
    if (out->count >= MAP_ADVICE_LINES)
        return;
    va_start(list, format);
    vsnprintf(out->line[out->count++], sizeof out->line[0], format, list);
    va_end(list);
}

// The first tag with too few observations to check its pose; NULL: none.
static const struct place_tag *rarely_observed(const struct place *place)
{
    enum { MIN_OBSERVATIONS = 3 };
    for (int32_t i = 0; i < place->tag_count; i++)
        if (place->tags[i].observations < MIN_OBSERVATIONS)
            return &place->tags[i];
    return NULL;
}

// The tag that fits clearly worse than the others; NULL: none. *others_px: how well those fit.
static const struct place_tag *worst_fit(const struct place *place, double *others_px)
{
    // Chosen on the tests' small world, where a side that is 5 % wrong gives 4.6 times the others' residual and right
    // ones up to 1.4 times; real films were left out.
    enum { MIN_TAGS = 4, MIN_OBSERVATIONS = 3 };
    const double times = 3, least_px = 0.1;
    const struct place_tag *worst = NULL;
    double sum = 0;
    int count = 0;
    for (int32_t i = 0; i < place->tag_count; i++) {
        const struct place_tag *tag = &place->tags[i];
        if (tag->observations < MIN_OBSERVATIONS)
            continue;
        sum += tag->rms_px;
        count++;
        worst = !worst || tag->rms_px > worst->rms_px ? tag : worst;
    }
    if (count < MIN_TAGS)
        return NULL;
    *others_px = (sum - worst->rms_px) / (count - 1);
    return worst->rms_px > least_px && worst->rms_px > times * *others_px ? worst : NULL;
}

static void say_worst_fit(const struct place *place, struct map_advice *out)
{
    double others_px;
    const struct place_tag *worst = worst_fit(place, &others_px);
    if (worst)
        say(out,
            "tag %d fits to %.2f pixels only, the others to %.2f: measure its black square, which the list says is "
            "%.3f m "
            "wide, and see that it hangs flat and firmly",
            (int)worst->id, worst->rms_px, others_px, worst->side_m);
}

static void say_side(const struct mapper_report *r, struct map_advice *out)
{
    if (r->all_wrong_side)
        say(out,
            "by the sensor's depth most tags are not as wide as the list says: tag %d looks "
            "%.3f m wide, the list says %.3f m; measure the black squares, correct the list and map "
            "again, else the place has the wrong scale; if they are right, the depth's unit is %.2f times too large",
            (int)r->first_wrong, r->measured_m, r->listed_side_m, r->measured_m / r->listed_side_m);
    else
        say(out,
            "tag %d looks %.3f m wide, the list says %.3f m; %s left out: measure the black square, "
            "correct the list and map again",
            (int)r->first_wrong, r->measured_m, r->listed_side_m,
            r->tags_wrong_side > 1 ? "it and others like it are" : "it is");
}

static void say_lens(const struct place *place, const struct mapper_report *r, struct map_advice *out)
{
    char text[LENS_TEXT_BYTES];
    if (r->lens.fault != LENS_FITS)
        say(out, "%s: calibrate the lens and map again%s", lens_verdict_text(&r->lens, text),
            place->tag_count ? ", before you change anything about the tags" : "");
}

static void say_tags(const struct mapper_report *r, struct map_advice *out)
{
    if (r->tags_unseen)
        say(out, "tag %d%s listed but in no picture; film it too, or take it off the list", (int)r->first_unseen,
            r->tags_unseen > 1 ? " and others are" : " is");
    if (r->tags_disconnected)
        say(out, "tag %d%s never in one picture with the other tags, and left out; film it together with one of them",
            (int)r->first_disconnected, r->tags_disconnected > 1 ? " and others are" : " is");
    if (r->tags_unlisted)
        say(out, "tag %d%s in the pictures but not listed, and ignored; measure it and list it", (int)r->first_unlisted,
            r->tags_unlisted > 1 ? " and others are" : " is");
    if (r->tags_outlier)
        say(out,
            "tag %d%s in two places of the sweep, and left out: it was moved meanwhile, or two tags "
            "have this number; hang it firmly and film again",
            (int)r->first_outlier, r->tags_outlier > 1 ? " and others are" : " is");
    if (r->tags_wrong_side && !(r->all_wrong_side && r->lens.fault != LENS_FITS))
        say_side(r, out);
    if (r->tags_moved)
        say(out,
            "tag %d%s no longer where the place had it; the place has it now where it hangs, as far "
            "as the sweep shows it beside others",
            (int)r->first_moved, r->tags_moved > 1 ? " and others are" : " is");
}

static void summarise(const struct place *place, struct map_advice *out)
{
    int used = snprintf(out->summary, sizeof out->summary, "%s fit to %.2f pixels",
                        place->tag_count ? "tags" : "points", place->rms_px);
    if (place->rms_m > 0)
        used +=
            snprintf(out->summary + used, sizeof out->summary - (size_t)used, ", depth to %.0f mm", place->rms_m * 1e3);
    for (int32_t i = 0; i < place->tag_count; i++) {
        const float *c = place->tags[i].covariance;
        const double sigma_m = sqrt(fmax((double)(c[15] + c[18] + c[20]), 0));
        if (sigma_m > out->worst_tag_m) {
            out->worst_tag_m = sigma_m;
            out->worst_tag = place->tags[i].id;
        }
    }
    if (out->worst_tag_m > 0)
        snprintf(out->summary + used, sizeof out->summary - (size_t)used, "; the worst tag is known to %.1f mm",
                 out->worst_tag_m * 1e3);
}

void map_advise(const struct place *place, const struct mapper_report *r, const struct sweep_trouble *trouble,
                struct map_advice *out)
{
    *out = (struct map_advice){.worst_tag = -1};
    const struct place_tag *seldom = rarely_observed(place);
    summarise(place, out);
    if (*trouble->cut)
        say(out, "%s: the map is of what was swept until then", trouble->cut);
    say_lens(place, r, out);
    if (!place->point_count)
        say(out, "there are no landmarks, so a camera is found only where it sees a tag; film "
                 "what can be recognised from two places");
    if (seldom)
        say(out, "tag %d is in %d picture%s only; film it again, together with others", (int)seldom->id,
            (int)seldom->observations, seldom->observations == 1 ? "" : "s");
    say_tags(r, out);
    if (r->lens.fault == LENS_FITS && !r->tags_wrong_side)
        say_worst_fit(place, out);
    if (!r->floor_from_depth)
        say(out, "the floor is in no depth picture, so height 0 is the lowest tag or landmark; film the floor too");
    if (r->lost_to_s > r->lost_from_s)
        say(out,
            "the sensor could not be located from %.1f s to %.1f s of the sweep; film that part again, "
            "more slowly, with more of what was seen before in sight",
            r->lost_from_s, r->lost_to_s);
    if (trouble->damaged)
        say(out, "%lld damaged pictures were left out", (long long)trouble->damaged);
}
