// How far a long call is, told to the function that its caller gave. What runs the call's stages
// says which part of it each of them is; loops count. Where nobody listens all of it costs a look
// at one pointer.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <mutex>

namespace raydix {

/// Calls the function that a caller gave with the part done: on any thread, one call at a time,
/// with parts that ascend by 1/256 or more. What it throws comes out of the call that told, and it
/// is not called again.
class ProgressListener {
public:
    /// `tell` must outlive this; empty: nobody listens.
    explicit ProgressListener(const std::function<void(double)>& tell) : tell_(tell) {}

    /// `part` of the whole is done. Others of less may still come, and are not told; nor is 1,
    /// which is for `finish`.
    void reach(double part) {
        if (tell_ && part < 1 && part >= due_.load(std::memory_order_relaxed)) tell(part);
    }
    /// All is done: tells 1.
    void finish();

private:
    void tell(double part);

    const std::function<void(double)>& tell_;
    std::atomic<double> due_{0};  // the least part to tell
    std::mutex telling_;
    bool ended_ = false;
};

/// Which part of a listener's whole the present stage is; none where nobody listens.
struct ProgressSpan {
    ProgressListener* listener = nullptr;
    double begin = 0, size = 0;

    [[nodiscard]] ProgressSpan part(double from, double to) const {
        return {listener, begin + from * size, (to - from) * size};
    }
    void reach(double part) const {
        if (listener != nullptr) listener->reach(begin + part * size);
    }
};

/// Of the stages on this thread, and in with_threads within them; loops do not hand it on.
[[nodiscard]] const ProgressSpan& progress_span();
/// Part `done`, 0 to 1, of the present stage is done.
inline void progress_at(double done) { progress_span().reach(done); }

/// For its lifetime the present stage of this thread is another.
class ProgressStage {
public:
    explicit ProgressStage(const ProgressSpan& span);
    /// Parts `from` to `to` of what is the present one.
    ProgressStage(double from, double to) : ProgressStage(progress_span().part(from, to)) {}
    ~ProgressStage();
    ProgressStage(const ProgressStage&) = delete;
    ProgressStage& operator=(const ProgressStage&) = delete;

private:
    ProgressSpan before_;
};

/// Counts what is done of parts `from` to `to` of the present stage.
class ProgressCounter {
public:
    explicit ProgressCounter(double all, double from = 0, double to = 1)
        : ProgressCounter(progress_span().part(from, to), all) {}
    ProgressCounter(const ProgressSpan& span, double all)
        : span_(span), scale_(all > 0 ? 1 / all : 0) {}
    /// Any thread; more than `all` together count as all.
    void add(double count) const {
        if (span_.listener == nullptr) return;
        const double done = done_.fetch_add(count, std::memory_order_relaxed) + count;
        span_.reach(done * scale_ < 1 ? done * scale_ : 1);
    }

private:
    ProgressSpan span_;
    double scale_;
    mutable std::atomic<double> done_{0};
};

}  // namespace raydix
