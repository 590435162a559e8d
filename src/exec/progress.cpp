#include "exec/progress.h"

#include <cmath>

#include "exec/parallel.h"

namespace raydix {
namespace {

constexpr double told_parts = 256;
thread_local ProgressSpan present_span;

}  // namespace

void ProgressListener::tell(double part) {
    isolated([&] {
        const std::scoped_lock lock(telling_);
        // One that was due while another was told may be so no more.
        if (ended_ || part < due_) return;
        due_ = (std::floor(part * told_parts) + 1) / told_parts;
        ended_ = true;  // unless the call comes back
        const ProgressStage none(ProgressSpan{});
        tell_(part);
        ended_ = part == 1;
    });
}

void ProgressListener::finish() {
    if (tell_) tell(1);
}

const ProgressSpan& progress_span() { return present_span; }

ProgressStage::ProgressStage(const ProgressSpan& span) : before_(present_span) {
    present_span = span;
}
ProgressStage::~ProgressStage() { present_span = before_; }

}  // namespace raydix
