// One plane through the function that quantises the boxes of wide nodes.
#pragma once

#include "layout/quantise.h"

namespace raydix::test {

struct QuantisedSteps {
    int below, above;
};

/// Steps at or below and at or above `at` on the x axis of a node that reaches from lo to hi.
inline QuantisedSteps quantised_steps(float lo, float hi, float at) {
    SlotBoxes boxes;
    boxes.set(3, {{at, 0, 0}, {at, 0, 0}});
    const QuantisedBoxes q = quantise(boxes, {{lo, 0, 0}, {hi, 0, 0}});
    return {q.lo[0][3], q.hi[0][3]};
}

}  // namespace raydix::test
