// The random films' joints as CSV, for calibration.
#include "tests/bench/bench_dice.h"

#include <stdio.h>
#include <string.h>

static const char *sight_name(enum dice_sight s)
{
    static const char *const names[] = {"visible", "hidden", "blocked", "outside"};
    return names[s];
}

struct dump_row {
    const struct dice_film *film;
    int frame;
    enum dice_mode mode;
    enum joint joint;
    struct dice_joint is;
};

static void print_vector(FILE *file, struct vec3 v) { fprintf(file, ",%.4f,%.4f,%.4f", v.x, v.y, v.z); }

static void print_row(FILE *file, const struct dump_row *r)
{
    const struct dice_plan *plan = &r->film->plan;
    const struct dice_frame *frame = &r->film->frame[r->frame];
    const char *slash = strrchr(plan->actor.motion, '/');
    fprintf(file, "%d,%d,%s,%s", plan->index, r->frame, joint_name(r->joint), dice_mode_name(r->mode));
    fprintf(file, ",%g", (double)r->is.confidence);
    print_vector(file, r->is.off_m);
    print_vector(file, r->is.less_off_m);
    fprintf(file, ",%s,%.1f,%.2f", sight_name(frame->sight[r->joint]), frame->facing_degrees, frame->distance_m);
    fprintf(file, ",%s,%s,%s,%d,%d\n", plan->actor.figure, slash ? slash + 1 : plan->actor.motion,
            dice_situation_name(plan->situation), plan->swept, plan->scale > 0.75 ? 640 : 320);
}

static const char header[] =
    "film,frame,joint,mode,confidence,error_x_m,error_y_m,error_z_m,less_rig_x_m,less_rig_y_m,less_rig_z_m,sight,"
    "facing_degrees,distance_m,figure,motion,situation,swept,width\n";

enum status dice_dump_write(const struct dice_film *films, int count, const char *path)
{
    FILE *file = fopen(path, "w");
    if (!file)
        return fail(ERR_IO, "%s cannot be written", path);
    struct dice_rig rig[DICE_MODES];
    for (int mode = 0; mode < DICE_MODES; mode++)
        rig[mode] = dice_rig_of(films, count, (enum dice_mode)mode);
    fputs(header, file);
    for (int i = 0; i < count; i++)
        for (int k = 0; k < films[i].plan.frames; k++)
            for (int mode = 0; mode < films[i].modes; mode++)
                for (int j = 0; j < JOINT_COUNT; j++) {
                    const struct dice_joint is =
                        dice_joint_of(&films[i].frame[k], (enum dice_mode)mode, (enum joint)j, &rig[mode]);
                    print_row(file, &(struct dump_row){&films[i], k, (enum dice_mode)mode, (enum joint)j, is});
                }
    return fclose(file) ? fail(ERR_IO, "%s could not be written", path) : OK;
}

// ---------------------------------------------------------------- features

enum { EVERY = 5 }; // frames: neighbours err alike

static void print_features_header(FILE *file)
{
    fputs("film,frame,joint,sight,facing,figure,situation", file);
    for (int pass = 0; pass < 2; pass++)
        for (int f = 0; f < FEATURE_COUNT; f++)
            fprintf(file, ",%s_%s", pass ? "backward" : "forward", joint_feature_name((enum joint_feature)f));
    for (int f = 0; f < SMOOTHED_COUNT; f++)
        fprintf(file, ",smoothed_%s", smoothed_feature_name((enum smoothed_feature)f));
    for (int mode = 0; mode < DICE_MODES; mode++) {
        const char *name = dice_mode_name((enum dice_mode)mode);
        fprintf(file, ",%s_confidence,%s_error_m,%s_less_m,%s_mahalanobis2,%s_sigma_m", name, name, name, name, name);
    }
    fputc('\n', file);
}

static void print_features(FILE *file, const struct dice_film *film, int k, enum joint j,
                           const struct dice_rig rig[DICE_MODES])
{
    const struct dice_frame *frame = &film->frame[k];
    fprintf(file, "%d,%d,%s,%s,%.0f,%s,%s", film->plan.index, k, joint_name(j), sight_name(frame->sight[j]),
            frame->facing_degrees, film->plan.actor.figure, dice_situation_name(film->plan.situation));
    for (int pass = 0; pass < 2; pass++)
        for (int f = 0; f < FEATURE_COUNT; f++)
            fprintf(file, ",%.4g", frame->evidence.pass[pass][j].value[f]);
    for (int f = 0; f < SMOOTHED_COUNT; f++)
        fprintf(file, ",%.4g", frame->evidence.smoothed[j].value[f]);
    for (int mode = 0; mode < DICE_MODES; mode++) {
        const struct dice_joint is = dice_joint_of(frame, (enum dice_mode)mode, j, &rig[mode]);
        // Of the covariance as it is before the models that are fitted to this.
        const double widening = mode == DICE_ONLINE     ? (double)frame->evidence.online_widening[j]
                                : mode == DICE_SMOOTHED ? (double)frame->evidence.smoothed_widening[j]
                                                        : 1;
        fprintf(file, ",%g,%.4f,%.4f,%.5g,%.5f", (double)is.confidence, is.error_m, is.less_m,
                is.mahalanobis2 * widening, joint_sigma_m(&frame->track[mode], j) / sqrt(widening));
    }
    fputc('\n', file);
}

enum status dice_features_write(const struct dice_film *films, int count, const char *path)
{
    FILE *file = fopen(path, "w");
    if (!file)
        return fail(ERR_IO, "%s cannot be written", path);
    struct dice_rig rig[DICE_MODES];
    for (int mode = 0; mode < DICE_MODES; mode++)
        rig[mode] = dice_rig_of(films, count, (enum dice_mode)mode);
    print_features_header(file);
    for (int i = 0; i < count; i++)
        for (int k = 0; k < films[i].plan.frames; k += EVERY)
            for (int j = 0; j < JOINT_COUNT; j++)
                if (dice_has_person(&films[i].frame[k].track[DICE_ONLINE]) &&
                    dice_has_person(&films[i].frame[k].track[DICE_SMOOTHED]))
                    print_features(file, &films[i], k, (enum joint)j, rig);
    return fclose(file) ? fail(ERR_IO, "%s could not be written", path) : OK;
}
