#pragma once
#include <components/gui_client/view.hpp>

#include <QColor>
#include <QWidget>

#include <functional>
#include <memory>

class QPlainTextEdit;
class QPushButton;
class QTableWidget;
class QLabel;

namespace atirma::console {

/// The telecommands of all operators, the newest first.
class command_list : public QWidget {
    Q_OBJECT
public:
    explicit command_list(std::function<void(std::uint32_t id)> call_back, QWidget* parent = nullptr);
    void show_snapshot(const snapshot& seen, utc_time now);
    void forget() { shown_.reset(); } ///< the colours have changed

private:
    const command_entry* chosen() const;
    void offer();
    void make_rows(const std::vector<command_entry>& before);

    QTableWidget* table_;
    QLabel* empty_;
    QPushButton* back_;
    std::function<void(std::uint32_t)> call_back_;
    std::shared_ptr<const std::vector<command_entry>> shown_;
    bool counts_ = false; ///< one of them is open: its time runs down
    utc_time shown_at_{};
};

const QColor& colour_of(command_phase phase);
/// "queued, 42 s left".
QString phase_text(const command_entry& of, utc_time now);

/// The received packets, decoded field by field and byte by byte.
class packet_list : public QWidget {
    Q_OBJECT
public:
    explicit packet_list(QWidget* parent = nullptr);
    void show_snapshot(const snapshot& seen);
    void forget() { shown_.reset(); } ///< the colours have changed

private:
    void inspect();

    QTableWidget* table_;
    QPlainTextEdit* details_;
    std::shared_ptr<const std::vector<std::shared_ptr<const raw_packet>>> shown_;
    std::uint64_t chosen_ = 0;
};

/// The components of the system, and the other operators.
class present_list : public QWidget {
    Q_OBJECT
public:
    explicit present_list(QWidget* parent = nullptr);
    void show_snapshot(const snapshot& seen, utc_time now);

private:
    QTableWidget* table_;
    QLabel* head_;
};

/// The alarms, the most severe first; each can be acknowledged.
class alarm_list : public QWidget {
    Q_OBJECT
public:
    /// `acknowledge` returns false if that is not possible now.
    explicit alarm_list(std::function<bool(const std::string& key)> acknowledge, QWidget* parent = nullptr);
    /// Those that are shown: one that comes meanwhile has not been read.
    void acknowledge_all();
    void show_snapshot(const snapshot& seen, utc_time now);

private:
    void show_log(const snapshot& seen);
    void measure_log();

    QTableWidget *table_, *log_;
    QPushButton* log_button_;
    std::shared_ptr<const std::vector<alarm_event>> logged_;
    bool log_measured_ = false; ///< its rows have their heights
    QLabel* empty_;
    std::string chosen() const;

    std::function<bool(const std::string&)> acknowledge_;
    std::vector<std::string> keys_; ///< of the rows
    std::vector<std::string> open_; ///< of those that are not acknowledged
    std::string pressed_;           ///< the chosen one when the button was pressed
};

} // namespace atirma::console
