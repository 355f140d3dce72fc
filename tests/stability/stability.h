// Hard cases: what each stage answers where its input is degenerate, ill-conditioned or damaged, and whether that is
// right. Run by `reenact-bench stability`, and by tests/system/test_stability, which compares with stored answers.
//
// A case asks the code as it ships (`shipped`), and next to it the textbook formula (`plain`) in float, double and 113
// bits. The last is the reference, unless the case names another. A case also runs without what guards the answer: the
// textbook formula in double, or `unguarded`. That must be judged wrong, by the same rule: so every case is seen to
// fail, in every run.
//
//     right   the kind of answer is the expected one, and a value is within `tolerance` of the reference
//     silent  an answer that is not right but looks like a good one: what must not be
//
// No case reads a clock or a random number; all but the kinds of answers of foreign libraries is the same bits on every
// machine. One thread.
#pragma once
#include "base/status.h"
#include "tests/stability/quad.h"

#include <stdio.h>

enum answer_kind {
    ANSWER_VALUE,
    ANSWER_AMBIGUOUS, // more than one value fits
    ANSWER_UNKNOWN,   // no value, and says so
    ANSWER_ERROR,     // the input is refused, with a sentence
};
extern const char *const answer_kind_names[];

enum { ANSWER_VALUES = 8, CASE_INPUTS = 9 };

struct answer {
    enum answer_kind kind;
    int count; // of values, with ANSWER_VALUE
    double value[ANSWER_VALUES];
};

static inline struct answer answer_of(enum answer_kind kind) { return (struct answer){.kind = kind}; }
struct answer answer_value(double value);
struct answer answer_values(const double *values, int count);
// OK: `value`; NOTHING: unknown; AMBIGUOUS; else an error, which must have a sentence.
struct answer answer_status(enum status status, double value);

// A textbook formula without guards, in three precisions; reference: the same in 113 bits or, where the formula is an
// approximation, what it approximates.
struct plain {
    int inputs, values;
    void (*in_float)(const float *in, float *out);
    void (*in_double)(const double *in, double *out);
    void (*in_quad)(const quad *in, quad *out);
    void (*reference)(const quad *in, quad *out);
};

struct stability_case {
    const char *asked, *guard;
    enum answer_kind expected;
    struct answer (*shipped)(const double *in);
    const struct plain *plain;                    // NULL: there is no formula, as of an image
    struct answer (*unguarded)(const double *in); // NULL: plain->in_double
    double in[CASE_INPUTS];
    double exact[ANSWER_VALUES]; // the reference where it is known: used where `plain` is NULL or exact_count is not 0
    int exact_count;
    double tolerance;
    const char *unit;     // of values, errors and tolerance; NULL: without
    bool guard_is_double; // what guards the answer is double precision: unguarded is plain->in_float
    bool foreign;         // values pass through a foreign library: only their kind is the same on every machine
};

struct stability_stage {
    const char *name;
    const struct stability_case *cases;
    int count;
};

// What became of a case.
struct stability_result {
    const struct stability_stage *stage;
    const struct stability_case *of;
    struct answer shipped, unguarded;
    double reference[ANSWER_VALUES];
    bool right, silent, guard_seen;          // guard_seen: without it the answer is judged wrong
    double error, float_error, double_error; // largest over the values; NaN: none
    double condition;                        // relative; NaN: none, INFINITY: the formula has no derivative there
};

int stability_case_count(void);
struct stability_result stability_run(int index);

// The answer as the table has it: "unknown", or its values to `digits` digits.
void stability_print_answer(char *out, size_t bytes, const struct answer *a, int digits);
// One line of the stored answers (tests/stability/answers.txt).
void stability_print_stored(char *out, size_t bytes, const struct stability_result *r);

// The formulas.
extern const struct plain plain_exp_map, plain_log_map, plain_slerp, plain_turn_between, plain_from_matrix,
    plain_angle_between, plain_unit, plain_unit_quat, plain_project, plain_undistort, plain_there_and_back, plain_hypot,
    plain_exp, plain_sin, plain_elbow, plain_asin_half_width, plain_sum_of_steps, plain_square_range, plain_solve2,
    plain_variance_along, plain_row_time, plain_triangulate;

// The stages, each in a file of its own.
extern const struct stability_stage stability_math, stability_geometry, stability_lens, stability_tags,
    stability_camera, stability_mapping, stability_depth, stability_body, stability_avatar, stability_retrieval,
    stability_drawing, stability_compare, stability_time, stability_readers, stability_recording;
