#include "exec/arithmetic_check.h"

#include "base/float_env.h"

namespace raydix {

std::string first_wrong_case(std::span<const ArithmeticResults> results) {
    const FloatEnvironment environment;
    struct Count {
        const char* what;
        std::uint32_t wrong = 0;
    };
    Count counts[] = {{"division"}, {"square root"},         {"a product and a sum apart"},
                      {"a sum"},    {"division of doubles"}, {"square root of doubles"}};
    const auto compare = [](Count& count, auto a, auto b) {
        if (std::memcmp(&a, &b, sizeof(a)) != 0 && !(std::isnan(a) && std::isnan(b))) ++count.wrong;
    };
    for (std::uint32_t i = 0; i < results.size(); ++i) {
        const ArithmeticResults r = results[i], e = compute_case(i);
        compare(counts[0], r.quotient, e.quotient);
        compare(counts[1], r.root, e.root);
        compare(counts[2], r.product_and_sum, e.product_and_sum);
        compare(counts[3], r.sum, e.sum);
        compare(counts[4], r.quotient_of_doubles, e.quotient_of_doubles);
        compare(counts[5], r.root_of_double, e.root_of_double);
    }
    for (const Count& count : counts)
        if (count.wrong != 0)
            return std::string("does not compute ") + count.what +
                   " with the host's bits: " + std::to_string(count.wrong) + " of " +
                   std::to_string(results.size()) + " cases differ";
    return {};
}

}  // namespace raydix
