#include "platform/vision/image_features.h"

#include "platform/vision/opencv_quiet.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/features2d.hpp>
#include <vector>

namespace
{

constexpr int CELL_PX = 40;   // the image is divided into cells of about this size
constexpr int EDGE_PX = 19;   // margin without features: a descriptor there would reach over the edge
constexpr int FAST_STEP = 10; // FAST's threshold, grey levels
// The pyramid: the ratio of two levels and their number.
constexpr float STEP = 1.2f;
constexpr int LEVELS = 6;
// The same for a region: every second level, in less than half the time; each level still coincides with one of the
// full pyramid.
constexpr float COARSE_STEP = 1.44f;
constexpr int COARSE_LEVELS = 3;
constexpr int SLOPE_REACH = 3;       // samples of the structure tensor to each side, pixels of the level
constexpr float SLOPE_SPREAD = 2.0f; // standard deviation of their Gaussian weights, pixels of the level

bool better(const cv::KeyPoint &a, const cv::KeyPoint &b)
{
    if (a.response != b.response)
        return a.response > b.response;
    if (a.pt.y != b.pt.y)
        return a.pt.y < b.pt.y;
    return a.pt.x != b.pt.x ? a.pt.x < b.pt.x : a.octave < b.octave;
}

// The strongest of each cell, so that one highly textured object does not take all.
std::vector<cv::KeyPoint> spread_over_cells(std::vector<cv::KeyPoint> &all, int width, int height, int capacity)
{
    int across = std::max(1, width / CELL_PX), down = std::max(1, height / CELL_PX);
    std::vector<int> taken((size_t)(across * down), 0);
    std::vector<cv::KeyPoint> kept;
    std::sort(all.begin(), all.end(), better);
    int each = std::max(1, 2 * capacity / (across * down)); // 2: about half of the cells have no texture
    for (const cv::KeyPoint &k : all) {
        int cx = std::min(across - 1, (int)(k.pt.x * (float)across / (float)width));
        int cy = std::min(down - 1, (int)(k.pt.y * (float)down / (float)height));
        if (cx >= 0 && cy >= 0 && (int)kept.size() < capacity && taken[(size_t)(cy * across + cx)]++ < each)
            kept.push_back(k);
    }
    return kept;
}

cv::Ptr<cv::ORB> make_orb(int capacity, float step, int levels)
{
    return cv::ORB::create(capacity, step, levels, EDGE_PX, 0, 2, cv::ORB::FAST_SCORE, 31, FAST_STEP);
}

struct slope_weights {
    float of[2 * SLOPE_REACH + 1]; // along one axis

    slope_weights()
    {
        float sum = 0;
        for (int i = -SLOPE_REACH; i <= SLOPE_REACH; i++)
            sum += of[i + SLOPE_REACH] = std::exp(-(float)(i * i) / (2 * SLOPE_SPREAD * SLOPE_SPREAD));
        for (float &w : of)
            w /= sum;
    }
};

void structure_tensor(const cv::Mat &image, const cv::KeyPoint &k, float scale, float out[3])
{
    static const slope_weights weights;
    int step = std::max(1, (int)std::lround(scale)); // the central difference spans two of them
    std::fill(out, out + 3, 0.0f);
    for (int j = -SLOPE_REACH; j <= SLOPE_REACH; j++) {
        int y = std::clamp((int)std::lround(k.pt.y + (float)j * scale), step, image.rows - 1 - step);
        const uint8_t *above = image.ptr(y - step), *row = image.ptr(y), *below = image.ptr(y + step);
        for (int i = -SLOPE_REACH; i <= SLOPE_REACH; i++) {
            int x = std::clamp((int)std::lround(k.pt.x + (float)i * scale), step, image.cols - 1 - step);
            float dx = (float)(row[x + step] - row[x - step]), dy = (float)(below[x] - above[x]);
            float weight = weights.of[i + SLOPE_REACH] * weights.of[j + SLOPE_REACH];
            out[0] += weight * dx * dx;
            out[1] += weight * dx * dy;
            out[2] += weight * dy * dy;
        }
    }
}

// OpenCV multiplies a level's pixel coordinate by its scale. This corrects for the level's first pixel being the mean
// of several (centres, not corners) and for its width being rounded to whole pixels.
double full_image_coordinate(float at, float scale, int length)
{
    double level = std::lround((float)length * (1 / scale));
    return ((double)(at / scale) + 0.5) * length / level - 0.5;
}

struct feature_list {
    struct feature *out;
    int capacity;
    int *count;
};

// left, top: of `image` in the whole image.
struct pyramid {
    float step;
    int left, top;
};

void write_features(const cv::Mat &image, const std::vector<cv::KeyPoint> &kept, const cv::Mat &descriptors,
                    const pyramid &of, const feature_list &list)
{
    for (size_t i = 0; i < kept.size() && *list.count < list.capacity; i++) {
        struct feature &f = list.out[(*list.count)++];
        f.scale = std::pow(of.step, (float)kept[i].octave);
        f.at = {(double)of.left + full_image_coordinate(kept[i].pt.x, f.scale, image.cols),
                (double)of.top + full_image_coordinate(kept[i].pt.y, f.scale, image.rows)};
        structure_tensor(image, kept[i], f.scale, f.slope);
        std::memcpy(f.descriptor, descriptors.ptr((int)i), sizeof f.descriptor);
    }
}

enum status fail_current_exception()
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

enum status features_detect(const uint8_t *gray, int width, int height, struct feature *out, int capacity, int *count)
{
    *count = 0;
    if (width < 4 * EDGE_PX || height < 4 * EDGE_PX || capacity <= 0)
        return OK;
    try {
        const cv::Mat image(height, width, CV_8UC1, const_cast<uint8_t *>(gray));
        auto orb = make_orb(capacity * 4, STEP, LEVELS);
        std::vector<cv::KeyPoint> all;
        orb->detect(image, all);
        std::vector<cv::KeyPoint> kept = spread_over_cells(all, width, height, capacity);
        cv::Mat descriptors;
        orb->compute(image, kept, descriptors);
        write_features(image, kept, descriptors, {STEP, 0, 0}, {out, capacity, count});
        return OK;
    } catch (...) {
        return fail_current_exception();
    }
}

enum status features_detect_region(const uint8_t *gray, int stride, const struct image_region *region,
                                   struct feature *out, int capacity, int *count)
{
    const int width = region->width, height = region->height;
    *count = 0;
    if (width < 4 * EDGE_PX || height < 4 * EDGE_PX || capacity <= 0)
        return OK;
    try {
        const uint8_t *first = gray + (size_t)region->top * (size_t)stride + (size_t)region->left;
        const cv::Mat image(height, width, CV_8UC1, const_cast<uint8_t *>(first), (size_t)stride);
        std::vector<cv::KeyPoint> kept;
        cv::Mat descriptors;
        make_orb(capacity, COARSE_STEP, COARSE_LEVELS)->detectAndCompute(image, cv::noArray(), kept, descriptors);
        write_features(image, kept, descriptors, {COARSE_STEP, region->left, region->top}, {out, capacity, count});
        return OK;
    } catch (...) {
        return fail_current_exception();
    }
}

// ---------------------------------------------------------------- features with a scale

namespace
{

// Lower than OpenCV's 0.04: printing in faint colours counts, and what is false is found out later.
constexpr double CONTRAST = 0.015;

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
        return fail_current_exception();
    }
}
