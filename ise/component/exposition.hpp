#pragma once
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ise::detail {

/// Metrics as text: Prometheus's format (version 0.0.4) or OpenMetrics 1.0. Pure.
class exposition {
public:
    enum class format { prometheus, open_metrics };
    enum class kind { counter, gauge, histogram };
    using labels = std::initializer_list<std::pair<std::string_view, std::string_view>>;

    explicit exposition(format as) : format_(as) {}

    /// Metrics of one name, in the order in which their names first come. That of a counter ends in "_total". `help`
    /// is one sentence.
    class family {
    public:
        void add(labels of, double value);
        void add(labels of, std::uint64_t value);
        /// Values at most `bounds[at].first` seconds: `bounds[at].second`, cumulated; `count` all, `sum` in seconds.
        void add_histogram(labels of, const std::vector<std::pair<double, std::uint64_t>>& bounds, std::uint64_t count,
                           double sum);

    private:
        friend class exposition;
        family(exposition& in, std::string name, std::string head)
            : in_(&in), name_(std::move(name)), text_(std::move(head)) {}
        void line(std::string_view suffix, std::string_view labels, std::string_view value);

        exposition* in_;
        std::string name_, text_;
        bool empty_ = true;
    };
    family& metric(std::string_view name, kind of, std::string_view help);

    std::size_t series() const noexcept { return series_; } ///< lines so far
    std::string text() const;
    static std::string_view content_type(format of) noexcept;

private:
    const format format_;
    std::size_t series_ = 0;
    std::map<std::string, std::size_t, std::less<>> places_;
    std::deque<family> families_; // which stay where they are
};

} // namespace ise::detail
