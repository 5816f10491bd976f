#pragma once
#include "activity.hpp"
#include "connections.hpp"
#include "styled.hpp"
#include "survey.hpp"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace ise::cli {

/// What `ise top` shows on a terminal: three tables (components, services, connections), the details of a component,
/// and help. Knows neither the terminal nor a clock: it is given surveys and keys, and makes pages of any size.
class top_view {
public:
    enum class table_kind : std::uint8_t { components, services, connections };

    /// `where`: the name server, for the heading.
    explicit top_view(std::string where);

    /// A survey that has just ended.
    void take(std::vector<surveyed> now, wall_time at);
    /// There is none: why. The last one is shown on, marked as old.
    void fail(std::string why) { trouble_ = std::move(why); }

    void press(const key_press& key);
    /// The user wants it to end.
    bool ended() const noexcept { return ended_; }
    /// The user wants the page to stand still.
    bool paused() const noexcept { return paused_; }

    /// Exactly `height` lines at most, each of `width` columns at most. Remembers what of it is visible.
    styled_page page(std::size_t width, std::size_t height);

private:
    struct cell {
        std::string text;
        style how = style::plain;
        double order = 0; ///< where the cells of the column are sorted as numbers
    };
    struct row {
        std::string id;        ///< the same from survey to survey
        std::string component; ///< whose details Enter shows
        std::vector<cell> cells;
    };
    struct column {
        std::string heading;
        std::size_t width = 0;  ///< 0: names, which share what the others leave
        std::size_t leaves = 0; ///< where it is narrow the highest one leaves first; 0: stays
        bool number = false;    ///< sorted as such, the greatest first, and to the right
    };
    struct table_state {
        std::size_t sort = 0; ///< column
        bool reversed = false;
        std::string selected; ///< row's id
        std::size_t top = 0;  ///< first visible row
    };
    struct history {
        std::deque<double> work, answer_s; ///< calls and packets per second; round trips of our questions
    };

    const std::vector<column>& columns_of(table_kind of) const;
    std::vector<row> rows_of(table_kind of) const;
    row component_row(const activity& of) const;
    std::vector<row> service_rows() const;
    std::vector<row> connection_rows() const;
    std::vector<row> visible_rows(table_kind of) const; ///< filtered and sorted
    table_state& state() { return tables_[static_cast<std::size_t>(shown_)]; }
    const table_state& state() const { return tables_[static_cast<std::size_t>(shown_)]; }
    std::size_t selected_at(const std::vector<row>& rows) const;

    void press_in_filter(const key_press& key);
    void press_in_details(const key_press& key);
    void press_in_table(const key_press& key);
    void press_letter(const std::string& typed);
    void move(std::ptrdiff_t by);
    void next_sort(std::ptrdiff_t by);

    styled_line heading(std::size_t width) const;
    styled_line totals(std::size_t width) const;
    styled_line tabs(std::size_t width) const;
    styled_line keys(std::size_t width) const;
    styled_page table_page(std::size_t width, std::size_t height);
    styled_page details_page(std::size_t width, std::size_t height);
    std::vector<styled_line> details(std::size_t width) const;
    void add_services(std::vector<styled_line>& to, const surveyed& of, const activity& meanwhile) const;
    void add_peers(std::vector<styled_line>& to, const surveyed& of, std::size_t width) const;
    void add_troubles(std::vector<styled_line>& to, const surveyed& of, const activity& meanwhile) const;
    const surveyed* last_of(const std::string& path) const;
    std::string providers_of(const std::string& service) const;

    std::string where_;
    std::vector<surveyed> before_, now_;
    std::vector<activity> activities_;
    std::vector<connection_line> connections_;
    std::map<std::string, history> histories_; ///< by path
    std::deque<double> calls_, packets_;       ///< of all
    wall_time at_{};
    std::string trouble_;

    table_kind shown_ = table_kind::components;
    table_state tables_[3];
    std::string filter_, filter_before_;
    bool filtering_ = false;
    std::optional<std::string> details_of_;
    std::size_t details_top_ = 0, details_lines_ = 0;
    bool help_ = false, paused_ = false, ended_ = false;
    std::size_t room_ = 1; ///< rows of the last page
};

/// "▁▃▇": the last `width` values, the greatest of them at the top; spaces where there are none yet.
std::string sparkline(const std::deque<double>& values, std::size_t width);

} // namespace ise::cli
