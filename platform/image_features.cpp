#include "platform/image_features.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/features2d.hpp>
#include <vector>

namespace
{

constexpr int CELL_PX = 40;   // the picture is divided into cells of about this size
constexpr int EDGE_PX = 19;   // nearer to the edge there is no whole descriptor
constexpr int FAST_STEP = 10; // grey levels by which a corner stands out
// Smaller copies of the picture, each so many times smaller than the last.
constexpr float STEP = 1.2f;
constexpr int LEVELS = 6;
// The same in a part of a picture: every second copy, which takes less than half of the time and still
// shows what another copy showed.
constexpr float COARSE_STEP = 1.44f;
constexpr int COARSE_LEVELS = 3;
constexpr int SLOPE_REACH = 3;       // samples to each side of a feature, of its copy's pixels
constexpr float SLOPE_SPREAD = 2.0f; // of their weights, standard deviation

bool better(const cv::KeyPoint &a, const cv::KeyPoint &b)
{
    if (a.response != b.response)
        return a.response > b.response;
    if (a.pt.y != b.pt.y)
        return a.pt.y < b.pt.y;
    return a.pt.x != b.pt.x ? a.pt.x < b.pt.x : a.octave < b.octave;
}

// The best few of each cell, so that one poster does not take all.
std::vector<cv::KeyPoint> spread(std::vector<cv::KeyPoint> &all, int width, int height, int capacity)
{
    int across = std::max(1, width / CELL_PX), down = std::max(1, height / CELL_PX);
    std::vector<int> taken((size_t)(across * down), 0);
    std::vector<cv::KeyPoint> kept;
    std::sort(all.begin(), all.end(), better);
    int each = std::max(1, 2 * capacity / (across * down)); // half of the cells are walls
    for (const cv::KeyPoint &k : all) {
        int cx = std::min(across - 1, (int)(k.pt.x * (float)across / (float)width));
        int cy = std::min(down - 1, (int)(k.pt.y * (float)down / (float)height));
        if (cx >= 0 && cy >= 0 && (int)kept.size() < capacity && taken[(size_t)(cy * across + cx)]++ < each)
            kept.push_back(k);
    }
    return kept;
}

cv::Ptr<cv::ORB> finder(int capacity, float step, int levels)
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

void slope_around(const cv::Mat &picture, const cv::KeyPoint &k, float scale, float out[3])
{
    static const slope_weights weights;
    int step = std::max(1, (int)std::lround(scale)); // the difference is taken over two of them
    std::fill(out, out + 3, 0.0f);
    for (int j = -SLOPE_REACH; j <= SLOPE_REACH; j++) {
        int y = std::clamp((int)std::lround(k.pt.y + (float)j * scale), step, picture.rows - 1 - step);
        const uint8_t *above = picture.ptr(y - step), *row = picture.ptr(y), *below = picture.ptr(y + step);
        for (int i = -SLOPE_REACH; i <= SLOPE_REACH; i++) {
            int x = std::clamp((int)std::lround(k.pt.x + (float)i * scale), step, picture.cols - 1 - step);
            float dx = (float)(row[x + step] - row[x - step]), dy = (float)(below[x] - above[x]);
            float weight = weights.of[i + SLOPE_REACH] * weights.of[j + SLOPE_REACH];
            out[0] += weight * dx * dx;
            out[1] += weight * dx * dy;
            out[2] += weight * dy * dy;
        }
    }
}

// OpenCV multiplies a pixel of a copy with its scale. But the copy's first pixel is the mean of several, and the copy
// is a whole number of pixels wide.
double whole(float at, float scale, int length)
{
    double copy = std::lround((float)length * (1 / scale));
    return ((double)(at / scale) + 0.5) * length / copy - 0.5;
}

void hand_out(const cv::Mat &picture, const std::vector<cv::KeyPoint> &kept, const cv::Mat &descriptors, float step,
              int left, int top, struct feature *out, int capacity, int *count)
{
    for (size_t i = 0; i < kept.size() && *count < capacity; i++) {
        struct feature &f = out[(*count)++];
        f.scale = std::pow(step, (float)kept[i].octave);
        f.at = {(double)left + whole(kept[i].pt.x, f.scale, picture.cols),
                (double)top + whole(kept[i].pt.y, f.scale, picture.rows)};
        slope_around(picture, kept[i], f.scale, f.slope);
        std::memcpy(f.descriptor, descriptors.ptr((int)i), sizeof f.descriptor);
    }
}

enum status failed()
{
    try {
        throw;
    } catch (const std::bad_alloc &) {
        return fail(ERR_MEMORY, "no memory to look for features");
    } catch (const std::exception &e) {
        return fail(ERR_SOLVER, "looking for features failed: %s", e.what());
    }
}

} // namespace

enum status features_find(const uint8_t *gray, int width, int height, struct feature *out, int capacity, int *count)
{
    *count = 0;
    if (width < 4 * EDGE_PX || height < 4 * EDGE_PX || capacity <= 0)
        return OK;
    try {
        const cv::Mat picture(height, width, CV_8UC1, const_cast<uint8_t *>(gray));
        auto orb = finder(capacity * 4, STEP, LEVELS);
        std::vector<cv::KeyPoint> all;
        orb->detect(picture, all);
        std::vector<cv::KeyPoint> kept = spread(all, width, height, capacity);
        cv::Mat descriptors;
        orb->compute(picture, kept, descriptors);
        hand_out(picture, kept, descriptors, STEP, 0, 0, out, capacity, count);
        return OK;
    } catch (...) {
        return failed();
    }
}

enum status features_find_in(const uint8_t *gray, int stride, int left, int top, int width, int height,
                             struct feature *out, int capacity, int *count)
{
    *count = 0;
    if (width < 4 * EDGE_PX || height < 4 * EDGE_PX || capacity <= 0)
        return OK;
    try {
        const uint8_t *first = gray + (size_t)top * (size_t)stride + (size_t)left;
        const cv::Mat picture(height, width, CV_8UC1, const_cast<uint8_t *>(first), (size_t)stride);
        std::vector<cv::KeyPoint> kept;
        cv::Mat descriptors;
        finder(capacity, COARSE_STEP, COARSE_LEVELS)->detectAndCompute(picture, cv::noArray(), kept, descriptors);
        hand_out(picture, kept, descriptors, COARSE_STEP, left, top, out, capacity, count);
        return OK;
    } catch (...) {
        return failed();
    }
}
