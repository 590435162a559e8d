// How queries find their way: each is asked of the ranks that it can reach, the nearest first, with
// the best answer so far, in rounds until nobody has work. What a round may send between two ranks
// is bounded; what does not fit waits for the next one.
//
// A Kind of query has:
//   Question                     what is sent of a query, plain data
//   Scalar                       the type of bounds
//   asks_all                     whether all ranks that it reaches must answer
//   size()                       queries of this rank
//   first(i, candidate)          the nearest rank; false if none is reached
//   reach(i, candidates)         all ranks that its best answer so far leaves, in order
//   question(i)
//   answer(questions)            answers questions, of all ranks together, and keeps the answers
//   put_answer(q, out)           writes the one of question q
//   most_answer_bytes()          that it writes for a question
// or, where answers have any length,
//   answer_some(questions, most, out)  answers questions of one rank, at least one, and stops after
//                                `most` bytes; returns how many
//   take(i, reader)              joins an answer to what is known
#pragma once

#include <algorithm>
#include <cstdint>
#include <exception>
#include <limits>
#include <string>
#include <vector>

#include "mpi/agree.h"
#include "mpi/compute_clock.h"
#include "mpi/exchange.h"
#include "mpi/rank_tree.h"

namespace raydix::mpi {

struct RoundLimits {
    std::uint64_t exchange_bytes;  // that a rank receives in a round, of either direction
    std::uint64_t message_bytes;   // of one message
};

template <class Kind>
class Rounds {
    using Question = typename Kind::Question;
    using Scalar = typename Kind::Scalar;
    static constexpr bool is_of_any_length = requires(Kind kind, Bytes out) {
        kind.answer_some(std::span<const Question>(), std::uint64_t{}, out);
    };
    static constexpr std::uint64_t reply_head = sizeof(std::uint64_t);  // how many are answered

public:
    Rounds(const Communicator& comm, Kind& kind, const RoundLimits& limits, ComputeClock& clock)
        : comm_(comm),
          kind_(kind),
          limits_(limits),
          clock_(clock),
          share_(limits.exchange_bytes / std::uint64_t(comm.size())),
          most_questions_(questions_within(kind, share_)),
          out_(std::size_t(comm.size())),
          sent_(std::size_t(comm.size())) {}

    /// Collective. `error`: what already went wrong here. Errors of any rank are thrown on all.
    void run(std::exception_ptr error, CallReport& report) {
        report_ = &report;
        compute(error, [&] {
            cursors_.resize(kind_.size());
            for (std::size_t i = 0; i < kind_.size(); ++i) active_.push_back(i);
            select();
        });
        while (agree_on_work(comm_, packed_, error) != 0) {
            ++report.rounds;
            report.questions += packed_;
            const Arrived questions = exchange(comm_, out_, limits_.message_bytes);
            std::vector<Bytes> replies(std::size_t(comm_.size()));
            compute(error, [&] { answer_all(questions, replies, report); });
            const Arrived answers = exchange(comm_, replies, limits_.message_bytes, error);
            compute(error, [&] {
                take_all(answers);
                select();
            });
        }
    }

private:
    /// The ranks that a query has asked are those up to this one in the order of candidates.
    struct Cursor {
        Candidate<Scalar> last{0, 0};
        std::uint32_t asked = 0;
        bool is_counted = false;  // in two_round_questions
    };
    struct Waiting {
        std::size_t query;
        std::uint32_t rank;
    };

    /// Questions that fit into a rank's share of a round, and whose answers do. At least one.
    static std::uint64_t questions_within(const Kind& kind, std::uint64_t share) {
        std::uint64_t most = share / sizeof(Question);
        if constexpr (!is_of_any_length)
            most = std::min(most, (share - std::min(share, reply_head)) / kind.most_answer_bytes());
        return std::max<std::uint64_t>(most, 1);
    }

    template <class Body>
    void compute(std::exception_ptr& error, const Body& body) {
        keep_error(error, [&] { clock_.run(body); });
    }

    /// Packs what goes out next.
    void select() {
        for (Bytes& bytes : out_) bytes.clear();
        for (auto& queries : sent_) queries.clear();
        packed_ = 0;
        std::vector<Waiting> again;
        again.swap(again_);
        for (const Waiting& waiting : again)
            if (!send(waiting.query, waiting.rank)) again_.push_back(waiting);
        std::size_t kept = 0;
        for (const std::size_t query : active_)
            if (!select_for(query)) active_[kept++] = query;
        active_.resize(kept);
    }

    /// Asks as many ranks more as were asked before, at least one: rounds then grow with the
    /// logarithm of the ranks that a query reaches. True once nobody is left to ask.
    bool select_for(std::size_t query) {
        Cursor& cursor = cursors_[query];
        if (!Kind::asks_all && cursor.asked == 0) {
            Candidate<Scalar> first;
            if (!kind_.first(query, first)) return true;
            if (send(query, first.rank)) cursor = {first, 1, false};
            return false;
        }
        kind_.reach(query, candidates_);
        if (!Kind::asks_all && !cursor.is_counted) {
            cursor.is_counted = true;
            report_->two_round_questions += 1 + candidates_.size();
        }
        std::uint32_t more =
            Kind::asks_all ? std::numeric_limits<std::uint32_t>::max() : std::max(cursor.asked, 1u);
        for (const Candidate<Scalar>& candidate : candidates_) {
            if (cursor.asked != 0 && !(cursor.last < candidate)) continue;
            if (more-- == 0 || !send(query, candidate.rank)) return false;
            cursor = {candidate, cursor.asked + 1, cursor.is_counted};
        }
        return true;
    }

    /// False where this round's share of that rank is used up.
    bool send(std::size_t query, std::uint32_t rank) {
        if (sent_[rank].size() >= most_questions_) return false;
        sent_[rank].push_back(query);
        put(out_[rank], kind_.question(query));
        ++packed_;
        return true;
    }

    void answer_all(const Arrived& questions, std::vector<Bytes>& replies, CallReport& report) {
        // Sorting and vectors of queries do more for one large batch than for many small ones.
        std::vector<Question> asked(questions.all().size() / sizeof(Question));
        if (!asked.empty())
            std::memcpy(asked.data(), questions.all().data(), questions.all().size());
        if constexpr (!is_of_any_length) kind_.answer(asked);
        std::size_t begin = 0;
        for (int rank = 0; rank < comm_.size(); ++rank) {
            const std::size_t n = questions.from(rank).size() / sizeof(Question);
            if (n == 0) continue;
            Bytes& reply = replies[std::size_t(rank)];
            put(reply, std::uint64_t{n});
            if constexpr (is_of_any_length) {
                const std::uint64_t answered =
                    kind_.answer_some(std::span(asked).subspan(begin, n), share_, reply);
                std::memcpy(reply.data(), &answered, sizeof(answered));
                report.answered += answered;
            } else {
                for (std::size_t q = begin; q < begin + n; ++q) {
                    kind_.put_answer(q, reply);
                    // About as long as all: room for it at once, not by doubling.
                    if (q == begin) reply.reserve(reply.size() * n + n);
                }
                report.answered += n;
            }
            begin += n;
        }
    }

    /// Queries that a rank did not answer in this round are asked again.
    void take_all(const Arrived& answers) {
        for (int rank = 0; rank < comm_.size(); ++rank) {
            const auto& queries = sent_[std::size_t(rank)];
            Reader reader(answers.from(rank));
            const std::uint64_t answered =
                reader.empty() ? 0 : reader.template take<std::uint64_t>();
            for (std::size_t k = 0; k < queries.size(); ++k) {
                if (k < answered)
                    kind_.take(queries[k], reader);
                else
                    again_.push_back({queries[k], static_cast<std::uint32_t>(rank)});
            }
        }
    }

    const Communicator& comm_;
    Kind& kind_;
    RoundLimits limits_;
    ComputeClock& clock_;
    std::uint64_t share_, most_questions_;
    std::vector<Bytes> out_;                      // [ranks], questions
    std::vector<std::vector<std::size_t>> sent_;  // [ranks], the queries that they are of
    std::uint64_t packed_ = 0;
    CallReport* report_ = nullptr;
    std::vector<Cursor> cursors_;      // [queries]
    std::vector<std::size_t> active_;  // queries that may ask more ranks
    std::vector<Waiting> again_;       // questions that were not answered
    std::vector<Candidate<Scalar>> candidates_;
};

/// Throws InputError unless each rank may ask each at least one question a round.
template <class Kind>
void require_share(const Communicator& comm, const RoundLimits& limits) {
    const std::uint64_t least = std::uint64_t(comm.size()) * sizeof(typename Kind::Question);
    if (limits.exchange_bytes < least)
        throw InputError("option exchange_bytes is " + std::to_string(limits.exchange_bytes) +
                         "; " + std::to_string(comm.size()) + " ranks need at least " +
                         std::to_string(least));
}

}  // namespace raydix::mpi
