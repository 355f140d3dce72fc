// Any bytes as a recording: opened, everything read, verified, repaired; what repair makes is sound.
#include "recording/recording.h"
#include "tests/fuzz/fuzz.h"

static void read_all(const char *path)
{
    struct recording *r;
    struct place place;
    if (fuzz_said(recording_open(&r, path)) != OK)
        return;
    if (fuzz_said(recording_read_place(r, &place)) == OK)
        place_free(&place);
    for (int i = 0; i < recording_take_count(r); i++) {
        struct take *t;
        if (fuzz_said(take_open_drawn(&t, r, recording_take_name(r, i))) != OK)
            continue;
        for (int64_t k = 0; k < take_frame_count(t) && k < 100; k++) {
            struct take_images images;
            fuzz_said(take_read(t, k, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &images));
        }
        take_close(&t);
    }
    recording_free(&r);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct recording_report found, report;
    const char *path = fuzz_file("input", data, size);
    read_all(path);
    const enum status status = fuzz_said(recording_verify(path, &found));
    const char *to = fuzz_path("repaired");
    const enum status repaired = fuzz_said(recording_repair(path, to, &report));
    FUZZ_CHECK(status != OK || repaired == NOTHING);
    if (repaired == OK) {
        const int64_t frames = report.frames;
        FUZZ_CHECK(recording_verify(to, &report) == OK);
        FUZZ_CHECK(report.frames == frames);
    }
    fuzz_remove("input");
    fuzz_remove("repaired");
    return 0;
}
