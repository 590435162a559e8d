// raydix_attack: seeded random cases against independent references, for some seconds.
//   raydix_attack [--seconds S] [--seed N|fresh] [--kinds A,B,...] [--case I] [--json FILE]
//                 [--list] [--planted]
// --planted spoils answers on purpose, which must be found (docs/attack.md).
// The kinds take turns by their share of the time. Exit code 1 if anything was found, 2 for usage.
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <random>
#include <stdexcept>

#include "attack/attack.h"

namespace raydix::attack {
namespace {

struct Arguments {
    double seconds = 60;
    std::uint64_t seed = 1;
    std::vector<Kind> kinds;
    std::optional<std::uint64_t> only_case;
    std::string json;
};

std::vector<Kind> kinds_named(std::string_view names) {
    std::vector<Kind> chosen;
    while (!names.empty()) {
        const std::string_view name = names.substr(0, names.find(','));
        names.remove_prefix(std::min(names.size(), name.size() + 1));
        const std::vector<Kind> all = all_kinds();
        const auto at = std::find_if(all.begin(), all.end(),
                                     [&](const Kind& kind) { return name == kind.name; });
        if (at == all.end()) throw std::invalid_argument("no kind " + std::string(name));
        chosen.push_back(*at);
    }
    return chosen;
}

std::uint64_t fresh_seed() {
    std::random_device device;
    return std::uint64_t{device()} << 16 ^ device();
}

Arguments parse(int count, char** words) {
    Arguments arguments;
    for (const Kind& kind : all_kinds()) arguments.kinds.push_back(kind);
    for (int i = 1; i < count; ++i) {
        const std::string_view name = words[i];
        if (name == "--list") {
            for (const Kind& kind : all_kinds()) std::puts(kind.name);
            std::exit(0);
        }
        if (name == "--planted") {
            planted_fault = true;
            continue;
        }
        if (i + 1 == count) throw std::invalid_argument(std::string(name) + " needs a value");
        const std::string value = words[++i];
        if (name == "--seconds")
            arguments.seconds = std::stod(value);
        else if (name == "--seed")
            arguments.seed = value == "fresh" ? fresh_seed() : std::stoull(value);
        else if (name == "--kinds")
            arguments.kinds = kinds_named(value);
        else if (name == "--case")
            arguments.only_case = std::stoull(value);
        else if (name == "--json")
            arguments.json = value;
        else
            throw std::invalid_argument("no option " + std::string(name));
    }
    return arguments;
}

/// Set by SIGINT and SIGTERM: the case that runs is finished, and the tally printed and written.
volatile std::sig_atomic_t stop_asked = 0;
void ask_to_stop(int) { stop_asked = 1; }

/// What runs now, for the signal handler.
char current_case[160] = "no case yet\n";

void say_where(int signal) {
    const char* text = current_case;
    if (write(STDERR_FILENO, "CRASHED in ", 11) < 0 ||
        write(STDERR_FILENO, text, std::strlen(text)) < 0) {
        // Nothing can be said: the exit code remains.
    }
    std::signal(signal, SIG_DFL);
    std::raise(signal);
}

void run_case(const Kind& kind, std::uint64_t seed, std::uint64_t index, Tally& tally) {
    std::snprintf(current_case, sizeof(current_case), "--kinds %s --seed %llu --case %llu\n",
                  kind.name, static_cast<unsigned long long>(seed),
                  static_cast<unsigned long long>(index));
    tally.count_case(kind.name);
    Case c(kind.name, seed, index, tally);
    try {
        kind.run(c);
    } catch (const std::exception& error) {
        c.found("unexpected exception", std::string("    ") + error.what() + "\n");
    }
}

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

/// The kind that had the least of its share runs next.
void take_turns(const Arguments& arguments, Tally& tally) {
    struct Turn {
        Kind kind;
        double spent = 0;
        std::uint64_t cases = 0;
    };
    std::vector<Turn> turns;
    for (const Kind& kind : arguments.kinds) turns.push_back({kind});
    const double end = now() + arguments.seconds;
    for (double before = now(); before < end && stop_asked == 0;) {
        const auto next = std::min_element(turns.begin(), turns.end(), [](auto& a, auto& b) {
            return a.spent / a.kind.weight < b.spent / b.kind.weight;
        });
        run_case(next->kind, arguments.seed, next->cases++, tally);
        const double after = now();
        next->spent += after - before;
        before = after;
    }
}

int run(const Arguments& arguments) {
    for (const int signal : {SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGILL})
        std::signal(signal, say_where);
    for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, ask_to_stop);
    std::printf("seed %llu\n", static_cast<unsigned long long>(arguments.seed));
    std::fflush(stdout);
    const double begin = now();
    Tally tally;
    if (arguments.only_case)
        for (const Kind& kind : arguments.kinds)
            run_case(kind, arguments.seed, *arguments.only_case, tally);
    else
        take_turns(arguments, tally);
    tally.print();
    if (!arguments.json.empty() &&
        !tally.write_json(arguments.json, arguments.seed, now() - begin)) {
        std::fprintf(stderr, "cannot write %s\n", arguments.json.c_str());
        return 2;
    }
    return tally.findings() == 0 ? 0 : 1;
}

}  // namespace
}  // namespace raydix::attack

int main(int count, char** words) {
    using namespace raydix::attack;
    try {
        return run(parse(count, words));
    } catch (const std::exception& error) {
        std::fprintf(stderr, "raydix_attack: %s\n", error.what());
        return 2;
    }
}
