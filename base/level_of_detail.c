#include "base/level_of_detail.h"

const char *const detail_names[DETAIL_COUNT] = {[DETAIL_PAPER] = "paper",
                                                [DETAIL_PARTS] = "parts",
                                                [DETAIL_FUSED] = "fused",
                                                [DETAIL_FULL] = "full",
                                                [DETAIL_AUTO] = "auto"};

bool detail_needs_avatar(enum detail detail) { return detail >= DETAIL_FUSED; }
