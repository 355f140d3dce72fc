#include "platform/vision/chequers.h"

#include "platform/vision/opencv_quiet.hpp"

#include <algorithm>
#include <opencv2/calib3d.hpp>
#include <vector>

namespace
{

enum status fail_current()
{
    try {
        throw;
    } catch (const std::bad_alloc &) {
        return fail(ERR_MEMORY, "no memory to look for the board");
    } catch (const std::exception &e) {
        return fail(ERR_SOLVER, "looking for the board failed (OpenCV: %s)", e.what());
    }
}

// Whether rows go anticlockwise of columns.
bool is_mirrored(const std::vector<cv::Point2f> &c, int columns, int rows)
{
    const cv::Point2f along = c[(size_t)columns - 1] - c[0], across = c[(size_t)(columns * (rows - 1))] - c[0];
    return along.x * across.y - along.y * across.x < 0;
}

} // namespace

enum status chequers_find(const uint8_t *gray, int width, int height, int columns, int rows, struct pixel *out)
{
    if (width < 16 || height < 16 || columns < 3 || rows < 3)
        return NOTHING;
    try {
        const cv::Mat image(height, width, CV_8UC1, const_cast<uint8_t *>(gray));
        std::vector<cv::Point2f> corners;
        if (!cv::findChessboardCornersSB(image, cv::Size(columns, rows), corners,
                                         cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY) ||
            corners.size() != (size_t)(columns * rows))
            return NOTHING;
        if (is_mirrored(corners, columns, rows))
            for (int r = 0; r < rows; r++)
                std::reverse(corners.begin() + r * columns, corners.begin() + (r + 1) * columns);
        for (size_t i = 0; i < corners.size(); i++)
            out[i] = {corners[i].x, corners[i].y};
        return OK;
    } catch (...) {
        return fail_current();
    }
}
