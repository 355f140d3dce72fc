// For OpenCV's wrappers: an error is thrown, and not printed as well. Each says it in a sentence of its own.
#pragma once
#include <opencv2/core/utility.hpp>

inline const bool opencv_is_quiet =
    (cv::redirectError([](int, const char *, const char *, const char *, int, void *) { return 0; }), true);
