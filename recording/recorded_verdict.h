// What is said of a take: whether it is good, for what, and what is wrong with it, in sentences. Kept in the file
// beside the take (table `verdict`, docs/format.md) with a checksum of the frames that it was made from, so that it
// never outlives them: where frames were trimmed or lost since, there is none, and it is made anew
// (capture/take_verdict.h).
//
// A take is filmed to be looked at from all sides, or to be compared with and done alongside, or nobody said which. A
// back that was never seen is a fault of the first use only.
#pragma once
#include "recording/recording.h"

enum verdict_purpose { PURPOSE_BOTH, PURPOSE_COMPARE, PURPOSE_WATCH, PURPOSE_COUNT };

// "both", "compare", "watch".
const char *verdict_purpose_name(enum verdict_purpose purpose);
bool verdict_purpose_named(const char *name, enum verdict_purpose *out); // false: no such name

enum verdict_use { USE_COMPARE = 1, USE_WATCH = 2, USE_ANY = 3 };
enum { VERDICT_LINES = 10, VERDICT_LINE_BYTES = 220, VERDICT_TEXT_BYTES = (VERDICT_LINES + 1) * VERDICT_LINE_BYTES };

struct verdict_line {
    unsigned spoils; // the uses that it spoils, a sum of enum verdict_use; 0: worth knowing only
    bool filming;    // only seen while it was filmed, not in the frames: kept when the verdict is made anew
    char text[VERDICT_LINE_BYTES];
};

struct take_verdict {
    enum verdict_purpose purpose;
    bool seen;       // a person was
    unsigned spoilt; // the uses that it is not good for
    int count;
    struct verdict_line line[VERDICT_LINES]; // worst first
};

// Adds a sentence and spoils those uses; beyond VERDICT_LINES only the latter.
void verdict_say(struct take_verdict *verdict, unsigned spoils, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

bool verdict_is_good_for(const struct take_verdict *verdict, enum verdict_use use);
// For its purpose. Of a take that was filmed for both: for comparing, which the headline then says.
bool verdict_is_good(const struct take_verdict *verdict);

// "good", "good for comparing", "good from all sides", "better once more", "no person was seen".
const char *verdict_headline(const struct take_verdict *verdict);
// Whether line i concerns the take's purpose.
bool verdict_shows_line(const struct take_verdict *verdict, int i);
// Headline and lines, joined by "; ". Returns out.
const char *verdict_text(const struct take_verdict *verdict, char out[VERDICT_TEXT_BYTES]);

// ---------------------------------------------------------------- in the file

// Which frames a verdict is of.
struct verdict_key {
    int64_t take;
    uint32_t index_crc;
};
struct verdict_key verdict_key_of(const struct take *take);

// Reads what is kept of the take, which must not be one of take_open_drawn. *fits: it was made from these frames; else
// its purpose and the lines seen while filming are all that holds. NOTHING: there is none that can be read. ERR_IO,
// ERR_MEMORY.
MUST_CHECK enum status recorded_verdict_read(const struct take *take, struct take_verdict *out, bool *fits);

// Keeps it in place of an earlier one. ERR_IO: also where another program writes the file. ERR_CORRUPT, ERR_FORMAT,
// ERR_MEMORY.
MUST_CHECK enum status recorded_verdict_write(const char *path, const struct verdict_key *key,
                                              const struct take_verdict *verdict);
