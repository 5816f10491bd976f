#pragma once
#include <components/gui_client/freshness.hpp>

#include <QWidget>

#include <memory>
#include <vector>

namespace atirma::console {

/// One value in large figures, with its unit and age.
class value_tile : public QWidget {
    Q_OBJECT
public:
    value_tile(const QString& label, const QString& tip, QWidget* parent = nullptr);
    /// An empty value is shown as unknown.
    void show_value(const QString& value, const QString& unit, freshness how, double age_seconds);
    const QString& value() const noexcept { return value_; }
    freshness how() const noexcept { return how_; }
    QSize sizeHint() const override { return {104, 58}; }
    QSize minimumSizeHint() const override { return {84, 46}; }

protected:
    void paintEvent(QPaintEvent*) override;

private:
    QString label_, tip_, value_, unit_, age_;
    freshness how_ = freshness::none;
};

/// Wind and courses around the boat, with the bow up: the sectors that it does not sail, the true and the apparent
/// wind, the direction of the waypoint, the course over ground.
class wind_dial : public QWidget {
    Q_OBJECT
public:
    explicit wind_dial(QWidget* parent = nullptr);
    void show_boat(const boat_view& boat, utc_time now);
    QSize sizeHint() const override { return {200, 200}; }
    QSize minimumSizeHint() const override { return {140, 140}; }

protected:
    void paintEvent(QPaintEvent*) override;

private:
    void paint_ring(QPainter& to, double radius) const;
    void paint_wind(QPainter& to, double radius) const;
    void paint_speeds(QPainter& to, double radius) const;
    bool apparent_holds() const;
    void paint_middle(QPainter& to, double radius) const;

    boat_view boat_;
    utc_time now_{};
    freshness wind_how_ = freshness::none, sailing_how_ = freshness::none;
};

/// A measured angle against the commanded one: a bar and a mark.
class actuator_gauge : public QWidget {
    Q_OBJECT
public:
    actuator_gauge(const QString& label, double low, double high, QWidget* parent = nullptr);
    void show_values(double commanded, double actual, freshness how, double age_seconds);
    QSize sizeHint() const override { return {150, 44}; }
    QSize minimumSizeHint() const override { return {100, 40}; }

protected:
    void paintEvent(QPaintEvent*) override;

private:
    QString label_;
    double low_, high_, commanded_ = 0, actual_ = 0;
    freshness how_ = freshness::none;
};

/// All instruments of the boat.
class instrument_panel : public QWidget {
    Q_OBJECT
public:
    explicit instrument_panel(QWidget* parent = nullptr);
    void show_boat(const boat_view& boat, utc_time now);

protected:
    void resizeEvent(QResizeEvent* event) override;

private:
    value_tile* add(const QString& name, const QString& label, const QString& tip);

    wind_dial* dial_;
    std::vector<value_tile*> tiles_;
    value_tile *sog_, *cog_, *heading_, *heel_, *dtw_, *btw_, *xte_, *eta_, *wind_, *battery_;
    actuator_gauge *rudder_, *sail_;
};

} // namespace atirma::console
