// Whether colour and depth of one sensor run by one clock, told by the times of their images alone.
//
// Streams of one clock begin and end at about the same time, whatever their rates, and what starts later than the other
// does not end later by as much. So a difference that is the same at both ends is an offset of the clocks; and where
// one stream lasts so many times as long as the other, and its images are as many times as far apart, its clock runs at
// another rate. A stream that was merely cut short has images no farther apart.
//
// Noticed from three frames of the slower stream on, an offset from six; less is as when a stream starts late. Pure.
#pragma once
#include "base/status.h"

#include <stdint.h>

enum { STREAM_TIMES_EARLY = 32 };

// Zero-initialised: no image yet.
struct stream_times {
    int64_t count, first_ns, last_ns;
    int64_t early_ns[STREAM_TIMES_EARLY]; // the first steps, until their median is known
    int64_t median_ns;                    // of those; 0: not known yet
    double steps;                         // from the first image to the last, missing ones counted
};

// The next image's time, later than those before.
void stream_times_add(struct stream_times *times, int64_t time_ns);

enum clock_fault {
    CLOCKS_AGREE,
    CLOCKS_SHIFTED, // colour's is `ahead_s` ahead of depth's
    CLOCKS_RATE,    // colour's counts `rate` times as many seconds as depth's
    CLOCKS_APART,   // no image of one is near one of the other, for another reason; `ahead_s` by their first images
};

struct clock_finding {
    enum clock_fault fault;
    double ahead_s, rate;
};

// pairs: how many depth images have a colour image.
struct clock_finding stream_clocks_judge(const struct stream_times *color, const struct stream_times *depth,
                                         int64_t pairs);

// The likely cause and what to do, in one sentence without a full stop. listed: the times are those of rgb.txt and
// depth.txt, which can be put right. "": they agree. Returns out.
enum { STREAM_CLOCKS_TEXT_BYTES = 320 };
const char *stream_clocks_text(const struct clock_finding *finding, bool listed, char out[STREAM_CLOCKS_TEXT_BYTES]);
