#include "platform/vision/scale_features.h"

#include "platform/vision/opencv_quiet.hpp"

#include <algorithm>
#include <opencv2/features2d.hpp>
#include <vector>

namespace
{

// Lower than OpenCV's 0.04: printing in faint colours counts, and what is false is found out later.
constexpr double CONTRAST = 0.015;

enum status fail_current()
{
    try {
        throw;
    } catch (const std::bad_alloc &) {
        return fail(ERR_MEMORY, "no memory to detect features");
    } catch (const std::exception &e) {
        return fail(ERR_SOLVER, "the detection of features failed (OpenCV: %s)", e.what());
    }
}

} // namespace

enum status scale_features_detect(const uint8_t *plane, int width, int height, struct scale_feature *out, int capacity,
                                  int *count)
{
    *count = 0;
    if (width < 16 || height < 16 || capacity <= 0)
        return OK;
    try {
        const cv::Mat image(height, width, CV_8UC1, const_cast<uint8_t *>(plane));
        std::vector<cv::KeyPoint> keypoints;
        cv::Mat descriptors;
        cv::SIFT::create(capacity, 3, CONTRAST)->detectAndCompute(image, cv::noArray(), keypoints, descriptors);
        for (size_t i = 0; i < keypoints.size() && *count < capacity; i++) {
            struct scale_feature &f = out[(*count)++];
            f.at = {keypoints[i].pt.x, keypoints[i].pt.y};
            f.size_px = keypoints[i].size;
            f.angle = keypoints[i].angle * 0.017453292519943295f;
            const float *d = descriptors.ptr<float>((int)i); // OpenCV has rounded them
            std::transform(d, d + SCALE_FEATURE_DIMENSIONS, f.descriptor, [](float v) { return (int16_t)v; });
        }
        return OK;
    } catch (...) {
        return fail_current();
    }
}
