// Damaged recordings: what verify must say of them, and that what repair makes of them is sound.
#pragma once
#include "recording/recording_schema.h"
#include "tests/support/recording_sample.h"

// Verify finds it and says `words`; repair makes sample_path("repaired"), which verify finds sound. The report is
// repair's.
static inline struct recording_report expect_repair(const char *path, const char *words)
{
    struct recording_report report, again;
    char repaired[128];
    snprintf(repaired, sizeof repaired, "%s", sample_path("repaired"));
    recording_remove_files(repaired);
    EXPECT_STATUS(recording_verify(path, &report), ERR_CORRUPT);
    bool said = false;
    for (int i = 0; i < report.findings && i < RECORDING_FINDINGS_MAX; i++)
        said = said || strstr(report.finding[i], words);
    if (!said)
        print_error("no finding says '%s'; the first is '%s'\n", words, report.finding[0]);
    EXPECT_TRUE(said);
    EXPECT_STATUS(recording_repair(path, repaired, &report), OK);
    EXPECT_STATUS(recording_verify(repaired, &again), OK);
    EXPECT_INT(again.frames, report.frames);
    return report;
}
