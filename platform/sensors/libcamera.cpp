// The tablet's camera through libcamera: libcamera, libcamera:N (from 0).
//
// A view-finder stream near the size the camera was calibrated with, otherwise
// near 640 x 480, in the offered format that converts to RGB with the least
// loss. Only the newest image is kept; those it replaces are counted as dropped,
// as are gaps in the camera's sequence numbers. Times are those of the exposure
// where the camera reports it, otherwise of the buffer. Uncompressed images can
// be exported as dma-bufs (source.h), but a few buffers always stay with
// the camera.
//
// libcamera knows no focal length; see camera_lens_read() and camera_lens_guess()
// in source_internal.h for where the calibration comes from.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic" // C headers: compound literals
extern "C" {
#include "base/text.h"
#include "platform/files/jpeg.h"
}
#include "base/pixels.h"
#include "platform/sensors/source_internal.h"
#pragma GCC diagnostic pop

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <libcamera/libcamera.h>
#include <linux/dma-buf.h>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <utility>
#include <vector>

namespace
{

using libcamera::formats::BGR888;
using libcamera::formats::MJPEG;
using libcamera::formats::NV12;
using libcamera::formats::RGB888;
using libcamera::formats::UYVY;
using libcamera::formats::XBGR8888;
using libcamera::formats::XRGB8888;
using libcamera::formats::YUYV;

constexpr unsigned BUFFERS = 8; // requested from the camera
constexpr int KEPT_BUFFERS = 3; // never exported, so that the camera can continue

// libcamera allows one manager in a process; all sources share it.
enum status get_manager(std::shared_ptr<libcamera::CameraManager> &out)
{
    static std::mutex lock;
    static std::weak_ptr<libcamera::CameraManager> shared;
    std::lock_guard<std::mutex> guard(lock);
    out = shared.lock();
    if (out)
        return OK;
    if (!std::getenv("LIBCAMERA_LOG_FILE"))
        libcamera::logSetTarget(libcamera::LoggingTargetNone); // the user gets a sentence instead
    auto fresh = std::make_shared<libcamera::CameraManager>();
    if (fresh->start() != 0)
        return fail(ERR_DEVICE, "libcamera does not start; is there a /dev/media or /dev/video that you may read?");
    shared = out = std::move(fresh);
    return OK;
}

std::string model_of(const libcamera::Camera &camera)
{
    return camera.properties().get(libcamera::properties::Model).value_or("camera");
}

// The bytes of a buffer's planes, mapped for reading.
class Mapping
{
  public:
    Mapping() = default;
    Mapping(const Mapping &) = delete;
    Mapping &operator=(const Mapping &) = delete;

    ~Mapping()
    {
        for (const auto &file : files_)
            munmap(file.second.first, file.second.second);
    }

    bool map(const libcamera::FrameBuffer &buffer)
    {
        std::map<int, size_t> sizes; // planes may share one file
        for (const auto &plane : buffer.planes()) {
            size_t end = size_t(plane.offset) + plane.length;
            size_t &size = sizes[plane.fd.get()];
            size = std::max(size, end);
        }
        for (const auto &size : sizes) {
            void *at = mmap(nullptr, size.second, PROT_READ, MAP_SHARED, size.first, 0);
            if (at == MAP_FAILED)
                return false;
            files_[size.first] = {at, size.second};
        }
        for (const auto &plane : buffer.planes())
            planes_.push_back(
                {static_cast<const uint8_t *>(files_[plane.fd.get()].first) + plane.offset, plane.length});
        return true;
    }

    // Brackets the processor's reads of what the camera wrote (cache coherency).
    void sync(bool begin) const
    {
        for (const auto &file : files_) {
            dma_buf_sync how = {};
            how.flags = (begin ? DMA_BUF_SYNC_START : DMA_BUF_SYNC_END) | DMA_BUF_SYNC_READ;
            (void)ioctl(file.first, DMA_BUF_IOCTL_SYNC, &how); // not every buffer needs or supports it
        }
    }

    size_t count() const { return planes_.size(); }
    const uint8_t *bytes(size_t plane) const { return planes_[plane].first; }
    size_t length(size_t plane) const { return planes_[plane].second; }

  private:
    std::map<int, std::pair<void *, size_t>> files_;
    std::vector<std::pair<const uint8_t *, size_t>> planes_;
};

// Shared by a source and its exported images, which may outlive it.
struct ExportState {
    std::mutex lock;                                           // guards what follows
    std::function<void(libcamera::Request *)> requeue_request; // empty after the source was closed
    int count = 0;                                             // exported and not released
};

// An exported image. It has its own file descriptors, because the camera may be closed before it is released.
struct DmabufFrame : dmabuf_image {
    std::shared_ptr<ExportState> exports;
    libcamera::Request *request = nullptr;
    libcamera::UniqueFD files[2];

    static void release_frame(dmabuf_image *l)
    {
        std::unique_ptr<DmabufFrame> self(static_cast<DmabufFrame *>(l));
        std::lock_guard<std::mutex> guard(self->exports->lock);
        self->exports->count--;
        if (self->exports->requeue_request)
            self->exports->requeue_request(self->request);
    }
};

class Source
{
  public:
    explicit Source(source_facts *facts) : facts_(facts), exports_(std::make_shared<ExportState>())
    {
        exports_->requeue_request = [this](libcamera::Request *request) { (void)requeue(request); };
    }
    Source(const Source &) = delete;
    Source &operator=(const Source &) = delete;

    ~Source()
    {
        {
            std::lock_guard<std::mutex> guard(exports_->lock);
            exports_->requeue_request = nullptr;
        }
        if (camera_) {
            camera_->requestCompleted.disconnect(this);
            camera_->disconnected.disconnect(this);
            if (started_)
                camera_->stop();
            requests_.clear();
            mappings_.clear();
            allocator_.reset();
            if (acquired_)
                camera_->release();
            camera_.reset();
        }
    }

    enum status open(size_t index)
    {
        enum status status = get_manager(manager_);
        if (status != OK)
            return status;
        auto cameras = manager_->cameras();
        if (cameras.empty())
            return fail(ERR_MISSING, "no camera is there that libcamera can use: plug one in, and see that you may "
                                     "read /dev/video* and /dev/media*");
        if (index >= cameras.size())
            return fail(ERR_MISSING, "there is no camera number %zu: %zu there, counted from 0", index, cameras.size());
        camera_ = cameras[index];
        name_ = model_of(*camera_);
        if (camera_->acquire() != 0)
            return fail(ERR_DEVICE, "the camera %s is in use by another program", name_.c_str());
        acquired_ = true;
        status = configure();
        if (status == OK)
            status = calibrate();
        if (status == OK)
            status = start();
        return status;
    }

    enum status next(frame *out)
    {
        libcamera::Request *request = nullptr;
        {
            std::unique_lock<std::mutex> guard(lock_);
            bool arrived =
                arrived_.wait_for(guard, std::chrono::seconds(5), [this] { return latest_ != nullptr || unplugged_; });
            request = std::exchange(latest_, nullptr);
            facts_->dropped += std::exchange(dropped_, 0);
            if (!request && unplugged_)
                return fail(ERR_DEVICE, "the camera %s was unplugged", name_.c_str());
            if (!arrived)
                return fail(ERR_DEVICE, "the camera %s has sent no picture for 5 seconds", name_.c_str());
        }
        enum status status = fill_frame(request, out);
        if (status == OK && facts_->dmabuf_enabled)
            out->dmabuf = export_dmabuf(request);
        if (!out->dmabuf && !requeue(request) && status == OK) {
            std::lock_guard<std::mutex> guard(lock_);
            unplugged_ = true; // reported by the next call; this image is valid
        }
        return status;
    }

  private:
    bool requeue(libcamera::Request *request)
    {
        request->reuse(libcamera::Request::ReuseBuffers);
        return camera_->queueRequest(request) == 0;
    }

    bool layout_of(dmabuf_layout *out) const
    {
        static const std::pair<libcamera::PixelFormat, dmabuf_layout> known[] = {{YUYV, DMABUF_YUYV},
                                                                                 {UYVY, DMABUF_UYVY},
                                                                                 {NV12, DMABUF_NV12},
                                                                                 {XBGR8888, DMABUF_RGBX},
                                                                                 {XRGB8888, DMABUF_BGRX}};
        for (const auto &pair : known)
            if (pair.first == format_) {
                *out = pair.second;
                return true;
            }
        return false;
    }

    // NULL: this image cannot be exported.
    dmabuf_image *export_dmabuf(libcamera::Request *request)
    {
        const auto &planes = request->buffers().begin()->second->planes();
        auto image = std::make_unique<DmabufFrame>();
        const size_t wanted = format_ == NV12 ? 2 : 1;
        if (!layout_of(&image->layout))
            return nullptr;
        for (size_t i = 0; i < wanted; i++) {
            const auto &plane = planes[std::min(i, planes.size() - 1)];
            image->files[i] = plane.fd.dup();
            if (!image->files[i].isValid())
                return nullptr;
            image->planes[i] = {image->files[i].get(), plane.offset, stride_};
            if (i == 1 && planes.size() == 1)
                image->planes[i].offset += stride_ * unsigned(height_); // directly after the luma plane
        }
        image->width = width_;
        image->height = height_;
        image->encoding = encoding_;
        image->request = request;
        image->exports = exports_;
        image->release = DmabufFrame::release_frame;
        std::lock_guard<std::mutex> guard(exports_->lock);
        if (exports_->count >= int(requests_.size()) - KEPT_BUFFERS)
            return nullptr;
        exports_->count++;
        return image.release();
    }

    enum status configure()
    {
        config_ = camera_->generateConfiguration({libcamera::StreamRole::Viewfinder});
        if (!config_ || config_->empty())
            return fail(ERR_DEVICE, "the camera %s has no view finder", name_.c_str());
        libcamera::StreamConfiguration &stream = config_->at(0);
        static const libcamera::PixelFormat preferred[] = {BGR888, RGB888, XBGR8888, XRGB8888, NV12, YUYV, UYVY, MJPEG};
        auto offered = stream.formats().pixelformats();
        for (const auto &format : preferred)
            if (std::find(offered.begin(), offered.end(), format) != offered.end()) {
                stream.pixelFormat = format;
                break;
            }
        lens stored = {};
        std::snprintf(facts_->camera_id, sizeof facts_->camera_id, "%s", camera_->id().c_str());
        lens_status_ = camera_lens_read(camera_->id().c_str(), &stored);
        if (lens_status_ < 0)
            return lens_status_;
        stream.size = lens_status_ == OK ? libcamera::Size(unsigned(stored.width), unsigned(stored.height))
                                         : libcamera::Size(640, 480);
        stream.bufferCount = BUFFERS;
        if (config_->validate() == libcamera::CameraConfiguration::Invalid || camera_->configure(config_.get()) != 0)
            return fail(ERR_DEVICE, "the camera %s cannot be set to %s", name_.c_str(), stream.toString().c_str());
        format_ = stream.pixelFormat;
        if (std::find(std::begin(preferred), std::end(preferred), format_) == std::end(preferred))
            return fail(ERR_DEVICE, "the camera %s gives its pictures as %s, which cannot be used", name_.c_str(),
                        format_.toString().c_str());
        width_ = int(stream.size.width);
        height_ = int(stream.size.height);
        stride_ = stream.stride;
        const bool subsampled = format_ == NV12 || format_ == YUYV || format_ == UYVY; // chroma subsampled along x
        if (width_ < 2 || height_ < 2 || width_ > 16384 || height_ > 16384 ||
            (subsampled && (width_ % 2 || height_ % 2)))
            return fail(ERR_DEVICE, "the camera %s gives pictures of %d x %d pixels, which cannot be used",
                        name_.c_str(), width_, height_);
        if (stream.colorSpace) {
            encoding_.full_range = stream.colorSpace->range == libcamera::ColorSpace::Range::Full;
            if (stream.colorSpace->ycbcrEncoding == libcamera::ColorSpace::YcbcrEncoding::Rec709)
                encoding_.matrix = YUV_BT709;
        }
        rgb_.resize(size_t(width_) * size_t(height_) * 3);
        return OK;
    }

    enum status calibrate()
    {
        calibration &c = facts_->calibration;
        c = {};
        c.registered = true;
        c.color_from_depth.rotation.w = 1;
        if (lens_status_ == NOTHING) {
            c.color = camera_lens_guess(width_, height_);
            return OK;
        }
        enum status status = camera_lens_read(camera_->id().c_str(), &c.color);
        return status == OK ? camera_lens_scale(&c.color, width_, height_, name_.c_str()) : status;
    }

    enum status start()
    {
        libcamera::Stream *stream = config_->at(0).stream();
        allocator_ = std::make_unique<libcamera::FrameBufferAllocator>(camera_);
        if (allocator_->allocate(stream) < 0)
            return fail(ERR_DEVICE, "the camera %s gives no memory for its pictures", name_.c_str());
        for (const auto &buffer : allocator_->buffers(stream)) {
            auto mapping = std::make_unique<Mapping>();
            if (!mapping->map(*buffer))
                return fail(ERR_DEVICE, "the memory of the camera %s cannot be read", name_.c_str());
            mappings_[buffer.get()] = std::move(mapping);
            auto request = camera_->createRequest();
            if (!request || request->addBuffer(stream, buffer.get()) != 0)
                return fail(ERR_DEVICE, "the camera %s takes no request", name_.c_str());
            requests_.push_back(std::move(request));
        }
        camera_->requestCompleted.connect(this, &Source::completed);
        camera_->disconnected.connect(this, &Source::disconnected);
        if (camera_->start() != 0)
            return fail(ERR_DEVICE, "the camera %s does not start", name_.c_str());
        started_ = true;
        for (const auto &request : requests_)
            if (camera_->queueRequest(request.get()) != 0)
                return fail(ERR_DEVICE, "the camera %s takes no request", name_.c_str());
        return OK;
    }

    // On libcamera's thread: keeps the newest image, requeues the one before it.
    void completed(libcamera::Request *request)
    {
        if (request->status() == libcamera::Request::RequestCancelled)
            return;
        libcamera::Request *unused = nullptr;
        const auto &metadata = request->buffers().begin()->second->metadata();
        {
            std::lock_guard<std::mutex> guard(lock_);
            if (metadata.status == libcamera::FrameMetadata::FrameSuccess) {
                unused = std::exchange(latest_, request);
                dropped_ += unused != nullptr;
                if (has_sequence_ && metadata.sequence > sequence_ + 1)
                    dropped_ += metadata.sequence - sequence_ - 1;
                has_sequence_ = true;
                sequence_ = metadata.sequence;
            } else {
                unused = request; // the image is damaged
                dropped_++;
            }
        }
        arrived_.notify_one();
        if (unused) {
            unused->reuse(libcamera::Request::ReuseBuffers);
            camera_->queueRequest(unused);
        }
    }

    void disconnected()
    {
        {
            std::lock_guard<std::mutex> guard(lock_);
            unplugged_ = true;
        }
        arrived_.notify_one();
    }

    enum status fill_frame(libcamera::Request *request, frame *out)
    {
        const libcamera::FrameBuffer *buffer = request->buffers().begin()->second;
        const Mapping &memory = *mappings_.at(buffer);
        int64_t time_ns = request->metadata()
                              .get(libcamera::controls::SensorTimestamp)
                              .value_or(int64_t(buffer->metadata().timestamp));
        time_ns += int64_t(facts_->calibration.color.readout_s / 2 * 1e9); // the camera's time is that of the first row
        if (time_ns <= last_ns_)
            time_ns = last_ns_ + 1; // some cameras report no times; keep them rising
        last_ns_ = time_ns;
        out->time_ns = time_ns;
        std::snprintf(out->name, sizeof out->name, "%04lld", static_cast<long long>(count_++));
        memory.sync(true);
        enum status status = convert(memory, *buffer, out);
        memory.sync(false);
        if (status == OK)
            out->color = rgb_.data();
        return status;
    }

    // NV12's chroma plane; libcamera gives it separately or directly after the luma plane.
    const uint8_t *chroma_of(const Mapping &memory) const
    {
        return memory.count() > 1 ? memory.bytes(1) : memory.bytes(0) + size_t(stride_) * size_t(height_);
    }

    enum status convert(const Mapping &memory, const libcamera::FrameBuffer &buffer, frame *out)
    {
        const uint8_t *in = memory.bytes(0);
        size_t rows = size_t(stride_) * size_t(height_);
        size_t needed = format_ == NV12 && memory.count() == 1 ? rows + rows / 2 : rows;
        if (format_ == MJPEG) {
            size_t bytes = std::min<size_t>(buffer.metadata().planes()[0].bytesused, memory.length(0));
            jpeg_.assign(in, in + bytes);
            if (jpeg_decode(jpeg_.data(), bytes, rgb_.data(), width_, height_) != OK)
                return fail(ERR_INPUT, "picture %s of the camera %s is damaged", out->name, name_.c_str());
            out->jpeg = jpeg_.data();
            out->jpeg_bytes = bytes;
            return OK;
        }
        if (memory.length(0) < needed || (format_ == NV12 && memory.count() > 1 && memory.length(1) < rows / 2))
            return fail(ERR_DEVICE, "the camera %s gives less than a picture", name_.c_str());
        const yuv_layout layout = {encoding_, width_, height_};
        if (format_ == NV12)
            pixels_from_nv12(in, stride_, chroma_of(memory), stride_, &layout, rgb_.data());
        else if (format_ == YUYV || format_ == UYVY)
            pixels_from_yuv422(in, stride_, format_ == YUYV, &layout, rgb_.data());
        else // libcamera names channels from the most significant byte: BGR888 has red in its first byte
            pixels_from_packed(in, stride_,
                               format_ == BGR888     ? PACKED_RGB
                               : format_ == RGB888   ? PACKED_BGR
                               : format_ == XBGR8888 ? PACKED_RGBX
                                                     : PACKED_BGRX,
                               width_, height_, rgb_.data());
        return OK;
    }

    source_facts *facts_;
    std::shared_ptr<ExportState> exports_;
    std::shared_ptr<libcamera::CameraManager> manager_; // must outlive the camera
    std::shared_ptr<libcamera::Camera> camera_;
    std::string name_;
    bool acquired_ = false, started_ = false;
    std::unique_ptr<libcamera::CameraConfiguration> config_;
    std::unique_ptr<libcamera::FrameBufferAllocator> allocator_;
    std::vector<std::unique_ptr<libcamera::Request>> requests_;
    std::map<const libcamera::FrameBuffer *, std::unique_ptr<Mapping>> mappings_;
    enum status lens_status_ = NOTHING; // OK: a calibration of this camera is stored
    libcamera::PixelFormat format_;
    int width_ = 0, height_ = 0;
    unsigned stride_ = 0;
    yuv_encoding encoding_ = {YUV_BT601, false};
    std::vector<uint8_t> rgb_, jpeg_;
    int64_t last_ns_ = 0, count_ = 0;

    std::mutex lock_; // guards what follows, shared with libcamera's thread
    std::condition_variable arrived_;
    libcamera::Request *latest_ = nullptr;
    int64_t dropped_ = 0;
    unsigned sequence_ = 0;
    bool has_sequence_ = false, unplugged_ = false;
};

// Turns exceptions into a status: none may leave this file.
template <typename Work> enum status guarded(Work work) noexcept
{
    try {
        return work();
    } catch (const std::bad_alloc &) {
        return fail(ERR_MEMORY, "no memory for the camera");
    } catch (const std::exception &error) {
        return fail(ERR_DEVICE, "the camera failed (libcamera: %s)", error.what());
    } catch (...) {
        return fail(ERR_DEVICE, "libcamera failed and does not say why");
    }
}

enum status libcamera_next(void *self, frame *out)
{
    return guarded([&] { return static_cast<Source *>(self)->next(out); });
}

void libcamera_close(void *self)
{
    (void)guarded([&] {
        delete static_cast<Source *>(self);
        return OK;
    });
}

} // namespace

extern "C" {

const struct source_kind libcamera_kind = {libcamera_next, libcamera_close};

enum status libcamera_open(void **self, const char *where, enum source_wanted, struct source_facts *facts)
{
    *self = nullptr;
    int index = 0;
    if (*where && !text_index(where, 999, &index))
        return fail(ERR_INPUT, "'libcamera:%s' does not say which camera; write libcamera:0 for the first", where);
    facts->live = true;
    return guarded([&] {
        auto source = std::make_unique<Source>(facts);
        enum status status = source->open(size_t(index));
        if (status == OK)
            *self = source.release();
        return status;
    });
}

enum status libcamera_devices(struct source_device *out, int capacity, int *count)
{
    *count = 0;
    return guarded([&] {
        std::shared_ptr<libcamera::CameraManager> manager;
        enum status status = get_manager(manager);
        if (status != OK)
            return status;
        for (const auto &camera : manager->cameras()) {
            if (*count < capacity) {
                std::snprintf(out[*count].uri, sizeof out[*count].uri, "libcamera:%d", *count);
                std::snprintf(out[*count].name, sizeof out[*count].name, "%.40s (%.80s)", model_of(*camera).c_str(),
                              camera->id().c_str());
            }
            ++*count;
        }
        return OK;
    });
}
}
