#include "compare/expectation.h"

#include "base/text.h"
#include "compare/difference.h"
#include "compare/score.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const double RAD = 180 / 3.14159265358979323846; // degrees in a radian

enum { ALL_PARTS = (1 << PART_COUNT) - 1 };

bool expectation_is_empty(const struct expectation *expectation)
{
    bool given = expectation && (expectation->ignored || expectation->to_s > 0);
    for (int p = 0; p < PART_COUNT && expectation; p++)
        given = given || expectation->tolerance_rad[p] > 0;
    given = given || (expectation && expectation->spread_references > 0);
    return !given;
}

struct expectation expectation_mirror(const struct expectation *expectation)
{
    struct expectation out = *expectation;
    out.ignored = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        const enum part other = mirrored_part((enum part)p);
        out.tolerance_rad[other] = expectation->tolerance_rad[p];
        memcpy(out.spread[other], expectation->spread[p], sizeof out.spread[other]);
        out.ignored |= (uint16_t)((expectation->ignored >> p & 1) << other);
    }
    return out;
}

struct tolerances tolerances_of(const struct expectation *expectation)
{
    struct tolerances out = {.ignored = expectation ? expectation->ignored : 0};
    for (int p = 0; p < PART_COUNT; p++) {
        const double given_rad = expectation ? expectation->tolerance_rad[p] : 0;
        for (int k = 0; k < DEVIATIONS; k++) {
            const double measured = expectation ? expectation->spread[p][k] : 0, other = measured > 0 ? measured : 1;
            out.spread[p][k] = given_rad > 0 ? given_rad / natural_offset_rad((enum part)p) : other;
        }
        out.threshold[p] = given_rad > 0 ? given_rad / DIFFERENT_RAD : out.spread[p][DEVIATION_OFFSET];
    }
    return out;
}

// ---------------------------------------------------------------- names

#define BIT(part)   (1u << PART_##part)
#define BOTH(part)  (BIT(LEFT_##part) | BIT(RIGHT_##part))
#define LEFT_ARM    (BIT(LEFT_UPPER_ARM) | BIT(LEFT_FOREARM))
#define RIGHT_ARM   (BIT(RIGHT_UPPER_ARM) | BIT(RIGHT_FOREARM))
#define LEFT_LEG    (BIT(LEFT_THIGH) | BIT(LEFT_SHIN))
#define RIGHT_LEG   (BIT(RIGHT_THIGH) | BIT(RIGHT_SHIN))
#define BOTH_TORSOS (BIT(UPPER_TORSO) | BIT(LOWER_TORSO))

// What is there on both sides, by the word for one; a text names the first of equal ones.
static const struct {
    const char *one, *two;
    uint16_t left, right;
} sided[] = {
    {"arm", "arms", LEFT_ARM, RIGHT_ARM},
    {"leg", "legs", LEFT_LEG, RIGHT_LEG},
    {"shoulder", "shoulders", BIT(LEFT_UPPER_ARM), BIT(RIGHT_UPPER_ARM)},
    {"elbow", "elbows", BIT(LEFT_FOREARM), BIT(RIGHT_FOREARM)},
    {"hip", "hips", BIT(LEFT_THIGH), BIT(RIGHT_THIGH)},
    {"knee", "knees", BIT(LEFT_SHIN), BIT(RIGHT_SHIN)},
    {"upper arm", "upper arms", BIT(LEFT_UPPER_ARM), BIT(RIGHT_UPPER_ARM)},
    {"forearm", "forearms", BIT(LEFT_FOREARM), BIT(RIGHT_FOREARM)},
    {"thigh", "thighs", BIT(LEFT_THIGH), BIT(RIGHT_THIGH)},
    {"shin", "shins", BIT(LEFT_SHIN), BIT(RIGHT_SHIN)},
};
static const struct {
    const char *name;
    uint16_t parts;
} single[] = {
    {"head", BIT(HEAD)},
    {"trunk", BOTH_TORSOS},
    {"upper torso", BIT(UPPER_TORSO)},
    {"lower torso", BIT(LOWER_TORSO)},
    {"torso", BOTH_TORSOS},
    {"all", ALL_PARTS},
};

// The same name in small letters and single blanks, without "the" and "both". False: it is too long for any.
static bool plain_word(const char *word, char out[32])
{
    size_t used = 0;
    for (; *word; word++) {
        const bool blank = *word == '_' || *word == '-' || isspace((unsigned char)*word);
        if (used >= 31)
            return false;
        if (!blank)
            out[used++] = (char)tolower((unsigned char)*word);
        else if (used && out[used - 1] != ' ')
            out[used++] = ' ';
    }
    used -= used && out[used - 1] == ' ';
    out[used] = 0;
    const size_t skip = strncmp(out, "both ", 5) ? 0 : 5;
    memmove(out, out + skip, used + 1 - skip);
    return true;
}

static uint16_t sided_parts(const char *word)
{
    const bool left = !strncmp(word, "left ", 5), right = !strncmp(word, "right ", 6);
    const char *noun = word;
    if (left || right)
        noun += left ? 5 : 6;
    for (size_t i = 0; i < COUNT_OF(sided); i++) {
        const bool one = !strcmp(noun, sided[i].one);
        if (!one && strcmp(noun, sided[i].two) != 0)
            continue;
        return (uint16_t)((right ? 0 : sided[i].left) | (left ? 0 : sided[i].right));
    }
    return 0;
}

enum status expectation_parts_named(const char *word, uint16_t *parts)
{
    char plain[32], shown[TEXT_SHOWN_BYTES];
    uint16_t found = 0;
    if (plain_word(word, plain)) {
        for (size_t i = 0; i < COUNT_OF(single); i++)
            if (!strcmp(plain, single[i].name))
                found = single[i].parts;
        found = found ? found : sided_parts(plain);
    }
    if (!found)
        return fail(
            ERR_INPUT,
            "'%s' is no part of the body: take head, trunk, arms, legs, shoulders, elbows, hips, knees, one side "
            "of these as in 'left knee', or all",
            text_shown(word, shown));
    *parts = found;
    return OK;
}

// ---------------------------------------------------------------- setting

enum status expectation_set_tolerance(struct expectation *expectation, const char *text)
{
    const char *equals = strchr(text, '=');
    char word[64], shown[TEXT_SHOWN_BYTES];
    double degrees = 0;
    uint16_t parts;
    if (!equals || !equals[1] || equals == text)
        return fail(ERR_INPUT, "a tolerance is given as PART=DEGREES, like knees=20, not '%s'",
                    text_shown(text, shown));
    snprintf(word, sizeof word, "%.*s", (int)(equals - text), text);
    const enum status status = expectation_parts_named(word, &parts);
    if (status != OK)
        return status;
    const double most = TOLERANCE_MAX_RAD * RAD;
    if (!text_number(equals + 1, &degrees) || !(degrees >= 1 && degrees <= most))
        return fail(ERR_INPUT, "a tolerance is 1 to %.0f degrees, not '%s'", most, text_shown(equals + 1, shown));
    for (int p = 0; p < PART_COUNT; p++)
        if (parts >> p & 1)
            expectation->tolerance_rad[p] = fmin(TOLERANCE_MAX_RAD, degrees / RAD);
    return OK;
}

enum status expectation_ignore(struct expectation *expectation, const char *word)
{
    uint16_t parts;
    const enum status status = expectation_parts_named(word, &parts);
    if (status != OK)
        return status;
    if ((expectation->ignored | parts) == ALL_PARTS)
        return fail(ERR_INPUT, "no part of the body would be left that matters");
    expectation->ignored |= parts;
    return OK;
}

enum status expectation_set_stretch(struct expectation *expectation, double from_s, double to_s, double seconds)
{
    const double from = from_s < 0 ? 0 : from_s, to = to_s < 0 ? seconds : to_s, shortest_s = 0.5;
    if (from >= seconds || to > seconds + 0.05) // what is rounded up in a text is still inside
        return fail(ERR_INPUT, "the stretch from %.1f s to %.1f s is not in the reference, which lasts %.1f s", from,
                    to, seconds);
    if (!(to - from >= shortest_s))
        return fail(ERR_INPUT, "a stretch lasts %.1f s or more; from %.1f s to %.1f s is none", shortest_s, from, to);
    expectation->from_s = from;
    expectation->to_s = fmin(to, seconds);
    return OK;
}

// ---------------------------------------------------------------- text

static void append_text(char *out, size_t size, const char *text)
{
    const size_t used = strlen(out);
    snprintf(out + used, size - used, "%s", text);
}

static void append_name(char *out, size_t size, const char *side, const char *name)
{
    append_text(out, size, *out ? ", the " : "the ");
    append_text(out, size, side);
    append_text(out, size, name);
}

// "the arms, the left knee": by as few names as cover them. Returns how many things are named, two of a kind as two.
static int name_parts(uint16_t parts, char *out, size_t size)
{
    int count = 0;
    *out = 0;
    if (parts == ALL_PARTS) {
        append_text(out, size, "everything");
        return 1;
    }
    for (size_t i = 0; i < COUNT_OF(single); i++)
        if ((parts & single[i].parts) == single[i].parts) {
            append_name(out, size, "", single[i].name);
            parts &= (uint16_t)~single[i].parts;
            count++;
        }
    for (size_t i = 0; i < COUNT_OF(sided); i++) {
        const bool left = (parts & sided[i].left) == sided[i].left, right = (parts & sided[i].right) == sided[i].right;
        if (left && right)
            append_name(out, size, "", sided[i].two);
        else if (left || right)
            append_name(out, size, left ? "left " : "right ", sided[i].one);
        parts &= (uint16_t) ~((left ? sided[i].left : 0) | (right ? sided[i].right : 0));
        count += left + right;
    }
    return count;
}

static void say_ignored(const struct expectation *expectation, char out[EXPECTATION_TEXT_BYTES])
{
    char names[300];
    if (!expectation->ignored)
        return;
    const int count = name_parts(expectation->ignored, names, sizeof names);
    append_text(out, EXPECTATION_TEXT_BYTES, names);
    append_text(out, EXPECTATION_TEXT_BYTES, count > 1 ? " do not matter" : " does not matter");
}

// Parts of one tolerance together; of those that do not matter none is said.
static void say_tolerances(const struct expectation *expectation, char out[EXPECTATION_TEXT_BYTES])
{
    uint16_t said = expectation->ignored;
    const char *between = *out ? "; " : "";
    for (int p = 0; p < PART_COUNT; p++) {
        const double rad = expectation->tolerance_rad[p];
        char names[300], text[340];
        uint16_t parts = 0;
        if (!(rad > 0) || said >> p & 1)
            continue;
        for (int q = p; q < PART_COUNT; q++)
            if (fabs(expectation->tolerance_rad[q] - rad) < 1e-9 && !(said >> q & 1))
                parts |= (uint16_t)(1u << q);
        said |= parts;
        if ((parts | expectation->ignored) == ALL_PARTS)
            snprintf(names, sizeof names, "%s", expectation->ignored ? "the rest" : "everything");
        else
            (void)name_parts(parts, names, sizeof names);
        snprintf(text, sizeof text, "%s%s within %.3g°", between, names, rad * RAD);
        append_text(out, EXPECTATION_TEXT_BYTES, text);
        between = ", ";
    }
}

const char *expectation_text(const struct expectation *expectation, char out[EXPECTATION_TEXT_BYTES])
{
    char text[120];
    *out = 0;
    if (expectation_is_empty(expectation))
        return out;
    say_ignored(expectation, out);
    say_tolerances(expectation, out);
    if (expectation->spread_references) {
        snprintf(text, sizeof text, "%swhat %d further reference%s differ%s by is right", *out ? "; " : "",
                 expectation->spread_references, expectation->spread_references > 1 ? "s" : "",
                 expectation->spread_references > 1 ? "" : "s");
        append_text(out, EXPECTATION_TEXT_BYTES, text);
    }
    if (expectation->to_s > 0) {
        snprintf(text, sizeof text, "%sonly %.1f s to %.1f s", *out ? "; " : "", expectation->from_s,
                 expectation->to_s);
        append_text(out, EXPECTATION_TEXT_BYTES, text);
    }
    return out;
}

// ---------------------------------------------------------------- of a take

bool expectation_from_take(const struct take_expectation *kept, int64_t first_ns, double seconds,
                           struct expectation *out)
{
    *out = (struct expectation){.ignored = kept->ignored};
    for (int p = 0; p < PART_COUNT; p++)
        out->tolerance_rad[p] = kept->tolerance_rad[p];
    if (kept->from_ns == kept->to_ns)
        return true;
    const double from_s = fmax(0, ((double)kept->from_ns - (double)first_ns) * 1e-9),
                 to_s = fmin(seconds, ((double)kept->to_ns - (double)first_ns) * 1e-9);
    if (!(to_s > from_s))
        return false;
    out->from_s = from_s;
    out->to_s = to_s;
    return true;
}

void expectation_to_take(const struct expectation *expectation, int64_t first_ns, double seconds,
                         struct take_expectation *kept)
{
    kept->ignored = expectation->ignored;
    for (int p = 0; p < PART_COUNT; p++)
        kept->tolerance_rad[p] = expectation->tolerance_rad[p];
    kept->from_ns = kept->to_ns = 0;
    if (!(expectation->to_s > 0) || (expectation->from_s <= 0 && expectation->to_s >= seconds))
        return;
    kept->from_ns = first_ns + (int64_t)llround(expectation->from_s * 1e9);
    kept->to_ns = first_ns + (int64_t)llround(expectation->to_s * 1e9);
}
