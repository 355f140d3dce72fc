// How much a take will take, before there is one: every two seconds one frame is coded as the recorder would code it.
#pragma once
#include "platform/sensors/source.h"

struct studio_rate {
    struct depth_coder *coder;
    int64_t measured_ns;
    double frame_bytes;
};

// Costs some milliseconds where a measurement is due. Without memory the last one stays.
void studio_rate_see(struct studio_rate *r, const struct frame *frame, const struct calibration *calibration,
                     int64_t now_ns);
void studio_rate_close(struct studio_rate *r);
