// The environment that arithmetic of the library needs, told by arithmetic and by the control
// register.
#include "base/float_env.h"

#include <gtest/gtest.h>

#if defined(__x86_64__)

namespace raydix {
namespace {

constexpr unsigned flush_to_zero = 0x8000, denormals_are_zero = 0x0040;
constexpr unsigned down = 0x2000, up = 0x4000, toward_zero = 0x6000;

class FloatEnv : public ::testing::Test {
protected:
    void TearDown() override { _mm_setcsr(saved_); }
    static bool is_plain_with(unsigned bits) {
        _mm_setcsr((_mm_getcsr() & ~0xE040u) | bits);
        EXPECT_EQ(FloatEnvironment::reads_plain(), FloatEnvironment::adds_plainly());
        return FloatEnvironment::is_plain();
    }

private:
    unsigned saved_ = _mm_getcsr();
};

TEST_F(FloatEnv, PlainOnlyWithoutAnySpecialBit) {
    EXPECT_TRUE(is_plain_with(0));
    for (const unsigned flush : {0u, flush_to_zero, denormals_are_zero, 0x8040u})
        for (const unsigned rounding : {0u, down, up, toward_zero})
            EXPECT_EQ(is_plain_with(flush | rounding), flush == 0 && rounding == 0)
                << flush << ' ' << rounding;
}

TEST_F(FloatEnv, IsSetAndRestored) {
    constexpr unsigned all = flush_to_zero | denormals_are_zero | toward_zero;
    EXPECT_FALSE(is_plain_with(all));
    {
        const FloatEnvironment plain;
        EXPECT_TRUE(FloatEnvironment::is_plain());
    }
    EXPECT_EQ(_mm_getcsr() & 0xE040u, all);
}

}  // namespace
}  // namespace raydix

#endif
